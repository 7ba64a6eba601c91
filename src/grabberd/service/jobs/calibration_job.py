"""Calibrating from a capture: a job."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import ExtraMissing
from grabberd.service.calibrations.calibration_frames import frame_document
from grabberd.service.clock import SystemClock, iso_utc
from grabberd.service.jobs.job_runner import Job, Progress
from grabberd.storage.state.calibration_store import CalibrationRecord, CalibrationStore

if TYPE_CHECKING:
    from grabberd.service.service import Service

Calibrator = Callable[[Path, Mapping[str, Any], Mapping[str, Any], Path, Progress], Mapping[str, Any]]
"""`calibrator(capture, frame_document, options, store, progress)`, at module level: it adds one calibration,
with its report, to the store in that folder and returns its id as `calibration`.
"""


def order_calibration(
    service: "Service",
    capture_id: str,
    frame: str | Mapping[str, Any] | None = None,
    options: Mapping[str, Any] | None = None,
    device: str | None = None,
    note: str = "",
) -> Job:
    """Queues the calibrating from a sealed capture of the calibration frame.

    Args:
        service: whose capture it is.
        capture_id: of the capture.
        frame: the calibration frame's name or its document; None: the one there is.
        options: the calibrator's.
        device: whose calibration it becomes; None: the capture's.
        note: for people.

    Raises:
        NotFound: there is no capture, calibration frame or device of that name.
        Conflict: the capture is still running.
    """
    path = service.archive.sealed_path(capture_id)
    owner = service.instrument(device or service.archive.document(capture_id).device).name
    return service.jobs.submit(
        "calibrate",
        capture_id,
        calibrate,
        calibrator=service.calibrator,
        capture=path,
        frame=frame_document(frame),
        options={**(options or {}), **({"note": note} if note else {})},
        store=service.calibrations.store.directory,
        record=CalibrationRecord(owner, "capture", note=note, capture=capture_id),
    )


def calibrate(
    progress: Progress,
    *,
    calibrator: Calibrator,
    capture: Path,
    frame: Mapping[str, Any],
    options: Mapping[str, Any],
    store: Path,
    record: CalibrationRecord,
) -> dict[str, Any]:
    """Calibrates into a scratch folder, draws the report and stores all of it at once, or nothing.

    Returns:
        What the calibrator returned; `calibration` is the id.

    Raises:
        GrabberdError: whatever the calibrator refuses; Conflict where the id is taken.
    """
    final = CalibrationStore(store)
    with final.scratch() as scratch:
        made = CalibrationStore(scratch)
        result = dict(calibrator(capture, frame, options, scratch, progress))
        entry = made.get(result["calibration"])
        report = _parsed(made.report(entry.id))
        page, record = _draw(report, record)
        record = replace(record, stored_utc=iso_utc(SystemClock().utc_now()))
        final.add(entry.document, record, report=report, page=page)
    return result


def _parsed(report: bytes | None) -> dict[str, Any] | None:
    return None if report is None else dict(json.loads(report))


def _draw(
    report: Mapping[str, Any] | None, record: CalibrationRecord
) -> tuple[str | None, CalibrationRecord]:
    """The report as a page; where it cannot be drawn the record says why.

    A fault in a picture must not cost the calibration.
    """
    if report is None:
        return None, record
    try:
        from grabberd.reports import calibration_html  # noqa: PLC0415 - the daemon itself never draws

        return calibration_html(report), record
    except ExtraMissing as error:
        return None, replace(record, missing_extra=error.extra)
    except Exception as error:
        return None, replace(record, page_problem=f"{type(error).__name__}: {error}")
