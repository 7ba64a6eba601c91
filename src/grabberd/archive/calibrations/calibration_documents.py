"""The documents of calibrations."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from grabberd.archive.state.calibration_store import StoredCalibration, moment_of
from grabberd.documents.calibrations import ActiveCalibration, CalibrationRow
from grabberd.documents.named_types import JsonObject

Document = Mapping[str, Any]
"""A calibration as its file has it."""
CONFIGURATION = "configuration"
FAILED = "failed"
_VERDICTS = ("passed", "passed_with_remarks", FAILED)
SECONDS_A_DAY = 86400.0
_OF_THE_DOCUMENT = ("created_utc", "source", "sigma0_px", "glass", "image")


def configured_row(document: Document, device: str) -> CalibrationRow:
    """A calibration that the configuration names."""
    return _row(document["id"], document, device=device, origin=CONFIGURATION)


def stored_row(entry: StoredCalibration) -> CalibrationRow:
    """A stored calibration; of a damaged one only the id and the problem."""
    record = entry.record
    if entry.problem is not None:
        return _row(entry.id, {}, problem=entry.problem)
    return _row(
        entry.document.get("id", entry.id),
        entry.document,
        device=record.device,
        origin=record.origin,
        note=record.note,
        capture=record.capture,
        stored_utc=record.stored_utc or None,
    )


def active_calibration(document: Document, now: datetime, activated_utc: str | None) -> ActiveCalibration:
    """The calibration that a device measures with, and its age."""
    return ActiveCalibration(
        id=document["id"],
        created_utc=document["created_utc"],
        age_days=round(age_days(document["created_utc"], now), 3),  # to some 90 s
        activated_utc=activated_utc,
    )


def newest_first(row: CalibrationRow) -> tuple[bool, datetime, str]:
    """Sort key, in reverse: the newest first, damaged ones last."""
    return row.created_utc is not None, moment_of(row.created_utc or "0001-01-01"), row.id


def age_days(created_utc: str, now: datetime) -> float:
    """Age in days; negative if the calibration was made by a clock ahead of this one."""
    return (now - moment_of(created_utc)).total_seconds() / SECONDS_A_DAY


def acceptance_of(document: Document) -> JsonObject | None:
    """The acceptance in a calibration's document; None for one that was not judged."""
    details = document.get("details")
    found = details.get("acceptance") if isinstance(details, Mapping) else None
    return dict(found) if isinstance(found, Mapping) and found.get("verdict") in _VERDICTS else None


def verdict_of(document: Document) -> str | None:
    """The verdict in a calibration's document; None for one that was not judged."""
    return (acceptance_of(document) or {}).get("verdict")


def failure_of(document: Document) -> str | None:
    """The reasons for which a calibration failed, in a sentence; None if it did not."""
    if verdict_of(document) != FAILED:
        return None
    reasons = (acceptance_of(document) or {}).get("reasons") or []
    said = [str(one.get("message")) for one in reasons if one.get("level") == FAILED]
    return f"the acceptance of calibration {document.get('id')} failed: {'; '.join(said) or 'see its report'}"


def _row(calibration_id: str, document: Document, **known: str | None) -> CalibrationRow:
    """A row of what its document and its record tell; `active`, `misfit` and `rejected` are entered later."""
    row: JsonObject = dict.fromkeys(CalibrationRow.model_fields)
    row |= {"id": calibration_id, "device": "", "note": "", "active": False}
    row |= {key: document.get(key) for key in _OF_THE_DOCUMENT}
    row["verdict"] = verdict_of(document)
    return CalibrationRow.model_validate(row | known)
