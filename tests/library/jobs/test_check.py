"""Checking a calibration: from a capture file, and as a job of the daemon."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from running import running, sealed

from grabberd.archive.calibrations.calibration_catalog import calibration_frame_document
from grabberd.documents.enums import JobState
from grabberd.errors import NotReady
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.library.jobs.calibration_frame import check_file
from grabberd.server.daemon.jobs import CheckJob
from grabberd.server.daemon.service import Service

FRAME_IN_VIEW = {"scene": "calibration_frame"}
PATIENCE_S = 60.0


def check(service: Service, **wanted: Any) -> CheckJob:
    frame = calibration_frame_document(None)
    return CheckJob.start(service.capture_control, service.instrument(None), frame, **wanted)


def test_the_daemon_captures_and_checks_and_says_what_to_do(tmp_path: Path) -> None:
    with running(tmp_path, FRAME_IN_VIEW) as service:
        job = service.jobs.submit(check(service, seconds=0.4))
        done = service.jobs.wait(job.id, PATIENCE_S)
        assert done.state is JobState.DONE, done.problem
        assert done.result.verdict == "fits"
        assert "go on measuring" in done.result.advice
        assert done.result.seen == done.result.of == 108
        assert done.result.fields == 20
        assert service.archive.document(job.subject).bits == 8


def test_a_calibration_of_before_is_told_from_a_capture_file(tmp_path: Path) -> None:
    with running(tmp_path, FRAME_IN_VIEW) as service:
        service.capture_control.start(None, CaptureRequest(fields=20, bits=8))
        path = sealed(service).path
        known = dict(service.instrument(None).setup.documents["calibration"])
    left = known["views"]["left"]
    before = {**known, "views": {**known["views"], "left": {**left, "y0_px": left["y0_px"] + 2.0}}}
    frame = calibration_frame_document(None)
    assert check_file(lambda _: None, path=path, calibration_frame=frame).verdict == "fits"
    found = check_file(lambda _: None, path=path, calibration_frame=frame, calibration=before)
    assert found.verdict == "recalibrate"
    assert found.parallax_px == pytest.approx(2.0, abs=0.2)
    assert found.reasons


def test_a_device_without_a_calibration_has_none_to_check(tmp_path: Path) -> None:
    with running(tmp_path, FRAME_IN_VIEW) as service:
        instrument = service.instrument(None)
        instrument.captures.setup = replace(instrument.setup, documents={"calibration": None, "object": None})
        with pytest.raises(NotReady, match="no calibration"):
            check(service)
