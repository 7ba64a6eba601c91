"""Analysis of a capture of the simulated grabber, from its file."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from archive.captures import ledger_of, meta
from archive.milkings import object_document
from core.chain.fake_scene import Scene, take_scene
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.ledger import Outcome, Slot
from grabberd.documents.document import JsonObject
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analyses.job import analyse_file, with_log

MATERIAL = {
    "law": "neo_hookean",
    "E_mpa": 3.0,
    "E_sigma_mpa": 0.1,
    "wall_mm": 2.5,
    "wall_sigma_mm": 0.05,
    "poisson": 0.5,
    "F0_n": 60.0,
    "F0_sigma_n": 3.0,
    "radius_mm": 12.5,
    "target_mm": 0.0,
    "first_end_mm": -65.0,
    "last_end_mm": 65.0,
}
VACUUM = {name: {"kpa": 42.0, "sigma_kpa": 0.3} for name in ("pulsation", "liner")}
INPUTS = {"reference": "nominal", "material": MATERIAL, "vacuum": VACUUM, "sought_kpa": 5.0}


UNREADABLE: dict[str, JsonObject | None] = {
    "calibration": {"schema": "grabberd/calibration/9", "id": "rig"},
    "object": {"targets": []},
    "settings": {"method": "by eye"},
}
"""Documents of a run that this version cannot read."""


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three fields of the open liner, of whose six columns both views see four."""
    return _sealed(tmp_path_factory.mktemp("opened") / "opened.grab.part")


@cache
def _scene() -> Scene:
    return take_scene(40)


def _sealed(path: Path, **stored: JsonObject | None) -> Path:
    """The open liner's capture, with other documents stored with its run."""
    scene = _scene()
    measured = scene.measured(8, "field")
    # An open liner hides more of its outermost columns than a closed one.
    opened = sorted(one.n for one in sorted(measured, key=lambda one: len(one.points))[:3])
    made_with = {
        "calibration": scene.setup.calibration.to_document(),
        "object": object_document(scene.setup.object_model),
        "settings": {"line_jitter_px": scene.setup.line_jitter_px},
        **stored,
    }
    writer = CaptureWriter.create(path, meta(bits=8))
    writer.begin_run(1, "live", "2026-03-01T09:30:00.000Z", "0.1.0", made_with)
    fields = [one for one in scene.packed(8, "field") if one.n in opened]
    taken = [Slot(one, one.n, Outcome.RECEIVED, None, (), one.time_ns) for one in fields]
    writer.append(taken)
    for n in opened:
        writer.append_points(1, n, measured[n].points)
    writer.commit()
    return writer.seal(ledger_of(taken), complete=True, ended_because="length reached")


def test_targets_that_one_view_alone_sees_have_a_pressure_but_no_point(opened: Path) -> None:
    analysis = analyse_file(lambda share: None, path=opened, inputs=INPUTS).analysis
    outermost = np.isin(analysis.grid.column, (0, analysis.grid.column.max()))
    for field, state in zip(analysis.fields, analysis.states, strict=True):
        alone = outermost & ~np.isin(analysis.grid.target, field.timed.points.target)
        assert alone.sum() > 10
        assert state.pressure is not None
        assert state.pressure.supported[alone].all()
        # Nothing presses on an open liner.
        assert np.abs(state.pressure.contact_kpa.value[alone]).max() < 3.0


def test_without_what_a_pressure_needs_the_fields_are_not_located_again(
    opened: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.core.chain.measure.single_view_images", None)
    made = analyse_file(lambda share: None, path=opened, inputs={"reference": "nominal"})
    assert all(state.pressure is None for state in made.analysis.states)


@pytest.mark.parametrize("document", ["calibration", "settings"])
def test_a_run_made_with_what_cannot_be_read_is_analysed_by_its_points(tmp_path: Path, document: str) -> None:
    path = _sealed(tmp_path / "opened.grab.part", **{document: UNREADABLE[document]})
    analysis = analyse_file(lambda share: None, path=path, inputs=INPUTS).analysis
    for field, state in zip(analysis.fields, analysis.states, strict=True):
        assert state.pressure is not None
        of_points = np.isin(analysis.grid.target, field.timed.points.target)
        assert not state.pressure.supported[~of_points].any()
        assert state.pressure.supported[of_points].all()
    (problem,) = [one for one in analysis.problems if "run 1" in one]
    assert str(path) in problem
    assert document in problem
    assert f"grabberd measure {path} --calibration" in problem


def test_a_burst_made_with_what_cannot_be_read_does_not_end_the_analysis(
    tmp_path: Path, opened: Path
) -> None:
    burst = _sealed(tmp_path / "burst.grab.part", calibration=UNREADABLE["calibration"])
    analysis = analyse_file(lambda share: None, path=opened, bursts=[burst], inputs=INPUTS).analysis
    outermost = np.isin(analysis.grid.column, (0, analysis.grid.column.max()))
    for state in analysis.states:
        assert state.pressure is not None
        assert state.pressure.supported[outermost].all()
    (problem,) = [one for one in analysis.problems if "run 1" in one]
    assert str(burst) in problem


def test_a_run_whose_object_model_cannot_be_read_is_refused_by_name(tmp_path: Path) -> None:
    path = _sealed(tmp_path / "opened.grab.part", object=UNREADABLE["object"])
    with pytest.raises(InputError, match="run 1 of ") as refused:
        analyse_file(lambda share: None, path=path, inputs=INPUTS)
    assert str(path) in refused.value.message
    assert f"grabberd measure {path} --calibration" in refused.value.hint


BY_LIGHT: JsonObject = {"vacuum": {"pulsation": "log", "liner": "log", "offset": "light"}}


def test_a_light_is_sought_in_the_pictures_by_the_log(opened: Path) -> None:
    rows = [f"{k / 100 - 1:.2f},{42 * (k % 100 < 50)},42,{k // 9 % 3 % 2}" for k in range(1000)]
    text = "\n".join(["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa,light", *rows])
    with pytest.raises(AnalysisError, match="no place in the picture goes on and off"):
        analyse_file(lambda share: None, path=opened, inputs=with_log(BY_LIGHT, text))


def test_a_log_without_a_light_cannot_relate_the_clocks_by_one(opened: Path) -> None:
    rows = [f"{k / 100 - 1:.2f},{42 * (k % 100 < 50)},42" for k in range(1000)]
    text = "\n".join(["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa", *rows])
    with pytest.raises(InputError, match="no column light"):
        analyse_file(lambda share: None, path=opened, inputs=with_log(BY_LIGHT, text))
