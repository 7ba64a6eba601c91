"""Captures that are analysed by themselves, from the request for a capture to what is shown of it."""

import time
from pathlib import Path

import pytest
import yaml
from running import PATIENCE_S, running, sealed, until

from grabberd.config import AnalysisConfig
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.server.daemon.service import Service
from grabberd_liner.analyses.documents import CaptureAnalysis
from grabberd_liner.part import liner_of

SHAPE = {"heights_mm": [0], "phases": 4}


@pytest.fixture
def by_itself(tmp_path: Path) -> AnalysisConfig:
    inputs = tmp_path / "inputs.yaml"
    inputs.write_text(yaml.safe_dump(SHAPE))
    return AnalysisConfig(when_sealed=True, inputs=inputs)


def analysed(service: Service, capture_id: str) -> CaptureAnalysis:
    """The capture's analysis once it has ended."""
    end_s = time.monotonic() + PATIENCE_S
    while True:
        found = service.archive.document(capture_id).analysis
        if found is not None and found.state not in ("queued", "running"):
            return found
        assert time.monotonic() < end_s, found
        time.sleep(0.05)


@pytest.mark.slow
def test_a_pulsating_liner_is_captured_and_its_quantities_are_there(
    tmp_path: Path, by_itself: AnalysisConfig
) -> None:
    with running(tmp_path / "state", analysis=by_itself) as service:
        capture_id = service.capture_control.start(None, CaptureRequest(fields=150)).id
        sealed(service)
        found = analysed(service, capture_id)
        assert (found.state, found.analysis, found.problem) == ("done", 1, None)
        quantities = {one.name: one for one in found.quantities}
        assert quantities["rate_per_min"].value == pytest.approx(60, abs=1)
        assert all(one.sigma is not None for one in found.quantities)
        assert {"liner_opening_s", "liner_closing_s", "wall_ratio"} <= quantities.keys()
        # It is told right after the job has ended, by the thread that ended it.
        latest = until(lambda: service.state().devices["simulated"].latest_analysis)
        assert (latest.capture, latest.analysis) == (capture_id, 1)
        assert next(liner_of(service).analyses.records(capture_id))["inputs"] == SHAPE
        service.annotations.delete(capture_id)


@pytest.mark.slow
def test_one_that_does_not_pulsate_says_so_and_stays_so(tmp_path: Path, by_itself: AnalysisConfig) -> None:
    with running(tmp_path / "state", analysis=by_itself) as service:
        capture_id = service.capture_control.start(None, CaptureRequest(fields=10)).id
        sealed(service)
        found = analysed(service, capture_id)
    assert found.state == "failed"
    assert found.problem
    assert "does not pulsate" in found.problem.message
    assert found.problem.hint
    with running(tmp_path / "state", analysis=by_itself) as service:
        liner_of(service).sealed_analyses.look()
        assert analysed(service, capture_id) == found
        assert [job.attempts for job in service.jobs.list()] == [1]
