"""Calibration documents for tests, and calibrators that a job can run in its process."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import shipped_configs
from grabberd.core.geometry import Calibration
from grabberd.documents.calibration_reports import CalibrationReport
from grabberd.documents.calibrations import CalibrationRow
from grabberd.documents.requests import CalibrationOptions
from grabberd.errors import MeasurementError
from grabberd.library.jobs.calibration import CalibrationOutput
from grabberd.server.daemon.service import Service
from grabberd.work.job_spec import Progress

Document = dict[str, Any]

SHIFT_MM = 0.25


def calibration(calibration_id: str, shift_mm: float = 0.0, **changes: Any) -> Document:
    """The simulated rig's, with both cameras shifted along Z: so are all points that it measures."""
    document: Document = json.loads((shipped_configs() / "fake.calibration.json").read_text())
    for view in document["views"].values():
        view["Z0_mm"] += shift_mm
    return document | {"id": calibration_id} | changes


def listed(service: Service) -> list[CalibrationRow]:
    """All calibrations of a service as they are listed."""
    heads, row = service.active.listing()
    return [row(head) for head in heads]


def failed(calibration_id: str) -> Document:
    """One whose acceptance failed, by its check length."""
    reason = {
        "code": "check_length",
        "level": "failed",
        "message": "the scale is off by +2 %",
        "hint": "look",
    }
    acceptance = {"verdict": "failed", "reasons": [reason]}
    return calibration(calibration_id, details={"acceptance": acceptance})


def exact(
    progress: Progress,
    *,
    paths: Sequence[Path],
    calibration_frame: Mapping[str, Any],
    options: CalibrationOptions,
    note: str | None,
    previous: Mapping[str, Any] | None = None,
) -> CalibrationOutput:
    """Knows the calibration without looking at the fields; its id ends as the calibration frame is called."""
    progress(0.5)
    with CaptureReader(paths[0]) as reader:
        details = {
            "fields": reader.field_count,
            "options": options.model_dump(exclude_none=True),
            "note": note,
            "captures": [one.stem for one in paths],
            "targets": len(calibration_frame["targets"]),
        }
    document = calibration(f"of-{paths[0].stem}", SHIFT_MM, details=details)
    # Without the numbers, which nobody looks at.
    report = CalibrationReport.model_construct(schema_="grabberd/calibration-report/1", id=document["id"])
    return CalibrationOutput(Calibration.from_document(document), report)


def without_result(progress: Progress, **_: Any) -> CalibrationOutput:
    """Finds no targets."""
    raise MeasurementError("2 of 108 targets were found", "light the calibration frame")
