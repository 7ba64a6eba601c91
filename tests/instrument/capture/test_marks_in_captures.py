"""Marks on the cup in captures: a rig that was knocked is corrected, live and when it is measured again."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from capturing import capture, points_of
from prometheus_client import generate_latest
from running import running

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.points_export import CORRECTIONS, export_csv
from grabberd.config.device import MarkConfig
from grabberd.core.measurement.marks import KEY, MarkReference
from grabberd.core.reconstruction.drift_check import MarkState, RigVerdict
from grabberd.library.jobs.measurement import measure_file
from grabberd.server.api.routes.metrics import registry_of
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import calibration_document, object_document

CUP = [
    {"id": 900 + i, "x_mm": x, "y_mm": y, "z_mm": 0.0}
    for i, (x, y) in enumerate([(60, 36), (-60, -36), (60, -36), (-60, 36)])
]
PLACES = [(314, 508), (45, 37), (46, 538), (313, 65), (673, 539), (404, 66), (404, 510), (672, 37)]
MARKS = [MarkConfig(x_px=x, y_px=y) for x, y in PLACES]
OPTIONS: dict[str, Any] = {"rig": {"marks": CUP}, "scene": "accuracy_object"}
KNOCK = {"kind": "knock", "at_field": 0, "what": "camera", "x_mrad": 0.5, "y_mrad": 0.4, "z_mrad": 0.5}
"""About two thirds of a pixel, of both views alike: no parallax tells of it."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The device's configuration with a calibration that has learnt its marks from a capture."""
    folder = tmp_path_factory.mktemp("learning")
    with running(folder, OPTIONS, marks=MARKS) as service:
        learning = capture(service, fields=80)
    with CaptureReader(learning) as reader:
        fields = list(reader.received())
    packed = [one.packed for one in fields]
    reference = MarkReference.learnt((one.parity, one.marks) for one in packed if one.marks is not None)
    assert reference is not None
    options = FakeOptions.read(OPTIONS)
    document = calibration_document(options) | {"details": {KEY: reference.to_document()}}
    calibration, model = folder / "rig.calibration.json", folder / "object.yaml"
    calibration.write_text(json.dumps(document))
    model.write_text(object_document(options))
    return {"marks": MARKS, "calibration": calibration, "object": model}


def mean_places(path: Path) -> dict[int, np.ndarray]:
    places: dict[int, list[tuple[float, ...]]] = {}
    for (_, target), xyz_mm in points_of(path).items():
        places.setdefault(target, []).append(xyz_mm)
    return {target: np.mean(own, axis=0) for target, own in places.items() if len(own) > 50}


def test_a_rig_that_was_knocked_before_is_corrected_from_the_first_field_on_and_measured_again_alike(
    tmp_path: Path, rig: dict[str, Any]
) -> None:
    with running(tmp_path / "before", OPTIONS, **rig) as service:
        before = capture(service, fields=60)
    with running(tmp_path / "after", OPTIONS | {"faults": [KNOCK]}, **rig) as service:
        capture(service, fields=100)  # the daemon has seen the rig for a second
        after = capture(service, fields=60)
        document = service.device_document(service.instrument(None)).rig
        made_with = service.instrument(None).setup.made_with
        metrics = generate_latest(registry_of(service, lambda: 0)).decode()
    assert document.verdict is RigVerdict.CORRECTED
    assert document.marks["left"].size_px == pytest.approx(0.75, abs=0.2)

    assert re.search(r'grabberd_rig\{device="[^"]+",verdict="corrected"\} 1\.0', metrics)
    assert re.search(r'grabberd_marks\{device="[^"]+",state="corrected",view="left"\} 1\.0', metrics)
    assert re.search(r'grabberd_rig_corrected_pixels\{device="[^"]+",view="left"\} 0\.[5-9]', metrics)

    known, found = mean_places(before), mean_places(after)
    off_mm = np.array([found[target] - known[target] for target in known.keys() & found.keys()])
    assert len(off_mm) > 50
    assert np.abs(off_mm.mean(axis=0)).max() < 0.02

    measure_file(lambda _: None, path=after, made_with=made_with)
    assert points_of(after, run=2) == points_of(after, run=1)
    with CaptureReader(after) as reader:
        assert reader.meta.extra["rig"]["corrected_px"]["right"] == pytest.approx(0.75, abs=0.2)
        first = reader.run(1).coverage["corrections"][0]  # type: ignore[index]
        assert [run.coverage["corrections"] for run in reader.runs][1] == [first]  # type: ignore[index]
    assert (first["n"], first["left"]["state"], first["left"]["marks"]) == (0, MarkState.CORRECTED, 4)

    export_csv(after, tmp_path / "table")
    with (tmp_path / "table" / CORRECTIONS).open() as file:
        rows = list(csv.DictReader(file))
    assert [row["view"] for row in rows] == ["left", "right"]
    assert float(rows[0]["shift_x_px"]) == first["left"]["shift_px"][0]


def test_without_a_knock_nothing_is_corrected(tmp_path: Path, rig: dict[str, Any]) -> None:
    with running(tmp_path, OPTIONS, **rig) as service:
        path = capture(service, fields=100)
        assert service.device_document(service.instrument(None)).rig.verdict is RigVerdict.FITS
    with CaptureReader(path) as reader:
        states = [one["left"]["state"] for one in reader.run(1).coverage["corrections"]]  # type: ignore[index]
        assert reader.meta.extra["rig"] == reader.meta.extra["rig"] | {"verdict": "fits"}
    assert set(states) <= {MarkState.AT_REST, MarkState.UNKNOWN}
