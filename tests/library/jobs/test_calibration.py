"""Calibrating from a capture: all of it is stored, or nothing."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from calibrators import calibration, exact, without_result
from slots import slot

from grabberd import reports
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.state.calibration_store import CalibrationStore
from grabberd.core.ledger import Ledger
from grabberd.documents.jobs import CalibrationResult
from grabberd.documents.requests import CalibrationOptions
from grabberd.errors import Conflict, ExtraMissing, MeasurementError
from grabberd.library.jobs.calibration_jobs import CalibrationJob
from grabberd.work.job_spec import JobContext

FRAME = {"targets": [{"id": 1}, {"id": 2}]}


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    meta = CaptureMeta(
        "c1", "2026-01-01T00:00:00.000Z", 0, {"name": "cup"}, {}, {}, {}, "", 1, "field", 50.0, "0"
    )
    writer = CaptureWriter.create(tmp_path / "c1.grab.part", meta)
    writer.append([slot(n) for n in range(3)])
    writer.commit()
    writer.seal(Ledger(), complete=True, ended_because="", measuring_failure=None)
    return writer.path


def run(
    capture: Path,
    calibrator: Any = exact,
    progress: Callable[[float], None] = lambda _: None,
    job_id: str = "job-1",
) -> Any:
    job = CalibrationJob(
        subject="c1",
        calibration_frame=FRAME,
        options=CalibrationOptions(tied=True),
        device="cup",
        note="new mirrors",
    )
    return job.run(progress, context(capture, calibrator, job_id))


def context(capture: Path, calibrator: Any, job_id: str) -> JobContext:
    folder = store_beside(capture).directory
    return JobContext(job=job_id, files={"c1": capture}, calibrations=folder, calibrator=calibrator)


def store_beside(capture: Path) -> CalibrationStore:
    return CalibrationStore(capture.parent / "calibrations")


def test_the_calibration_is_stored_with_its_report_and_what_is_known_of_it(capture: Path) -> None:
    shares: list[float] = []
    assert run(capture, progress=shares.append) == CalibrationResult(calibration="of-c1")
    entry = store_beside(capture).get("of-c1")
    details = {
        "fields": 3,
        "options": {"tied": True},
        "note": "new mirrors",
        "captures": ["c1"],
        "targets": 2,
    }
    assert entry.document["details"] == details
    assert (entry.record.device, entry.record.note, entry.record.capture) == ("cup", "new mirrors", "c1")
    assert entry.record.stored_utc.endswith("Z")
    report = store_beside(capture).report("of-c1")
    assert report is not None
    assert json.loads(report)["id"] == "of-c1"
    assert shares == [0.5]


def test_its_report_is_drawn_as_a_page(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "calibration_html", lambda document: f"<p>{document['id']}</p>")
    run(capture)
    assert store_beside(capture).page("of-c1") == b"<p>of-c1</p>"


def test_without_what_draws_it_the_calibration_is_kept_and_says_what_is_missing(
    capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(_: Mapping[str, Any]) -> str:
        raise ExtraMissing("drawing", "report")

    monkeypatch.setattr(reports, "calibration_html", missing)
    run(capture)
    record = store_beside(capture).get("of-c1").record
    assert (record.missing_extra, record.page_problem) == ("report", None)
    assert store_beside(capture).page("of-c1") is None


def test_a_fault_in_the_drawing_does_not_cost_the_calibration(
    capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reports, "calibration_html", lambda document: document["nothing"])
    run(capture)
    record = store_beside(capture).get("of-c1").record
    assert record.page_problem == "KeyError: 'nothing'"


def test_what_cannot_be_calibrated_stores_nothing(capture: Path) -> None:
    with pytest.raises(MeasurementError):
        run(capture, without_result)
    assert list(store_beside(capture).directory.glob("*")) == []


def test_an_attempt_after_one_that_had_stored_it_stores_nothing_more(capture: Path) -> None:
    first = run(capture)
    assert run(capture, without_result) == first, "it does not calibrate again"
    with pytest.raises(Conflict):
        run(capture, job_id="job-2")


def test_an_id_that_is_taken_is_refused_and_what_is_there_stays(capture: Path) -> None:
    store_beside(capture).add(calibration("of-c1"))
    with pytest.raises(Conflict):
        run(capture)
    assert store_beside(capture).get("of-c1").document == calibration("of-c1")
    assert [path.name for path in store_beside(capture).directory.iterdir()] == ["of-c1"]
