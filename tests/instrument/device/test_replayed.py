"""What is recorded and measured again gives the same points, bit for bit."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from capturing import capture, fixed_threshold, points_of, replaying, thresholds_of
from running import PATIENCE_S, running, sealed

from grabberd.archive.export.field_pictures import export_png
from grabberd.config import ThresholdConfig
from grabberd.documents.enums import JobState
from grabberd.errors import CalibrationMismatch
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.library.jobs.measurement import MeasurementJob


def test_a_calibration_of_pictures_of_another_size_is_refused(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for n in range(4):
        cv2.imwrite(str(pictures / f"{n}.png"), np.zeros((288, 360), np.uint8))
    with replaying(tmp_path, pictures) as service, pytest.raises(CalibrationMismatch, match="720"):
        service.capture_control.start(None, CaptureRequest())


def test_measuring_the_file_again_gives_the_same_points_bit_for_bit(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        path = capture(service, fields=30)
        job = service.jobs.submit(
            MeasurementJob(subject=path.stem, made_with=service.instrument(None).setup.made_with)
        )
        done = service.jobs.wait(job.id, PATIENCE_S)
        assert done.state is JobState.DONE, done.problem
        assert done.result.run == 2
        assert points_of(path, run=2) == points_of(path, run=1)


@pytest.mark.parametrize("bits", [1, 8])
def test_a_replay_of_exported_pictures_gives_the_same_points_bit_for_bit(tmp_path: Path, bits: int) -> None:
    with running(tmp_path / "live", **fixed_threshold()) as service:
        live = capture(service, fields=40, bits=bits, lines="field")
    export_png(live, tmp_path / "pictures")
    with replaying(tmp_path, tmp_path / "pictures") as service:
        again = capture(service, bits=bits, lines="field")
        assert sealed(service).recorder.ledger.complete
        assert len(points_of(live)) > 2000
        assert points_of(again) == points_of(live)


@pytest.mark.parametrize("lines", ["doubled", "field"])
def test_a_replay_of_a_capture_file_gives_the_same_points_bit_for_bit(tmp_path: Path, lines: str) -> None:
    with running(tmp_path / "live", **fixed_threshold()) as service:
        live = capture(service, fields=40, bits=1, lines=lines)
    with replaying(tmp_path, live) as service:
        assert points_of(capture(service, bits=1, lines=lines)) == points_of(live)


def test_the_same_recording_gives_the_same_thresholds_and_points_each_time(tmp_path: Path) -> None:
    with running(tmp_path / "live") as service:
        recording = capture(service, fields=30, bits=8)
    thresholds, points = [], []
    for again in ("one", "two"):
        with replaying(tmp_path / again, recording, threshold=ThresholdConfig()) as service:
            path = capture(service)
            thresholds.append(thresholds_of(path))
            points.append(points_of(path))
    assert thresholds[0] == thresholds[1]
    assert len(set(thresholds[0])) == 1
    assert points[0] == points[1]
