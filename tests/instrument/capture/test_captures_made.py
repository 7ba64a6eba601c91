"""What a capture has in its file: every field, the points of each, and what it was made with."""

from pathlib import Path

import numpy as np
import pytest
from capturing import capture, thresholds_of
from running import PATIENCE_S, live, running, sealed

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import ThresholdConfig
from grabberd.core.chain.light import field_threshold
from grabberd.core.field import unpack
from grabberd.core.measurement import ThresholdRule
from grabberd.instrument.capture.capture_request import CaptureRequest


def test_a_capture_has_all_its_fields_and_the_points_of_each(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=64)
        with CaptureReader(path) as reader:
            assert reader.ledger.complete
            assert reader.meta.complete
            assert [field.n for field in reader.received()] == list(range(64))
            assert [n for n, _ in reader.points()] == list(range(64))
            assert all(len(points) > 60 for _, points in reader.points())


def test_the_file_says_what_it_was_made_with(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=5, note="second udder", labels={"cow": "112"})
        with CaptureReader(path) as reader:
            assert reader.meta.device["driver"] == "fake"
            assert reader.meta.labels == {"cow": "112"}
            assert reader.meta.note == "second udder"
            assert reader.runs[0].made_with["calibration"]["schema"] == "grabberd/calibration/1"
            assert len(reader.runs[0].made_with["object"]["targets"]) == 108


def test_points_lie_near_the_simulators_truth(tmp_path: Path) -> None:
    from grabberd_fake import truth_at  # noqa: PLC0415

    with running(tmp_path) as service:
        path = capture(service, fields=50)
        options = service.instrument(None).setup.config.options
        with CaptureReader(path) as reader:
            errors = []
            for _, time_ns, points in reader.timed_points():
                truth = truth_at(options, time_ns)
                place = dict(zip(truth.ids.tolist(), truth.xyz_mm, strict=True))
                errors += [xyz - place[int(t)] for t, xyz in zip(points.target, points.xyz_mm, strict=True)]
        error = np.linalg.norm(errors, axis=1)
        assert np.sqrt((error**2).mean()) < 0.12
        assert error.max() < 1.0, "no target has another's id"


@pytest.mark.parametrize(("bits", "lines"), [(1, "field"), (4, "field"), (8, "field"), (8, "doubled")])
def test_other_bits_re_arm_the_ring_first(tmp_path: Path, bits: int, lines: str) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=10, bits=bits, lines=lines)
        with CaptureReader(path) as reader:
            packed = reader.field(3).numbered.packed
            assert (packed.bits, packed.y_step) == (bits, 1 if lines == "doubled" else 2)
            assert sum(len(points) for _, points in reader.points()) > 600


def test_without_a_wish_a_capture_has_the_bits_of_the_configuration(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        capture(service, fields=5, bits=8)
        with CaptureReader(capture(service, fields=5)) as reader:
            assert reader.meta.bits == 1


def test_the_fields_before_the_trigger_belong_to_the_capture(tmp_path: Path) -> None:
    with live(tmp_path) as service:
        reader = service.instrument(None).pipeline.ring.reader()
        for _ in range(12):
            assert reader.take(PATIENCE_S)
        with CaptureReader(capture(service, fields=20, pre_trigger_fields=10)) as file:
            before = [field.time_ns < file.meta.start_ns for field in file.received()]
            assert sum(before) >= 10
            assert len(before) == 20


@pytest.mark.parametrize("threshold", [ThresholdConfig(), ThresholdConfig(map=True)])
def test_a_live_capture_has_one_chosen_threshold_from_its_first_field_on(
    tmp_path: Path, threshold: ThresholdConfig
) -> None:
    with live(tmp_path, threshold=threshold) as service:
        (chosen,) = set(thresholds_of(capture(service, fields=25)))
        assert 30 < chosen < 110
        path = capture(service, fields=5, bits=8)
        (grey,) = set(thresholds_of(path))
        with CaptureReader(path) as reader:
            field = unpack(next(iter(reader.received())).packed)
        assert abs(grey - field_threshold(field, ThresholdRule(), 8, doubled=False)) <= 1, "chosen anew"


def test_a_capture_ends_though_the_index_cannot_be_written(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        index = service.archive.index.path
        service.capture_control.start(None, CaptureRequest(fields=16))
        index.unlink()
        index.mkdir()
        recording = sealed(service)
        assert recording.complete
        assert recording.path.suffix == ".grab"
        index.rmdir()
        service.archive.index.rebuild()
        assert service.archive.document(recording.id).verdict == "complete"
