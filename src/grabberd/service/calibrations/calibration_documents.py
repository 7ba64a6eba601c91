"""How calibrations are shown."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from grabberd.storage.state.calibration_store import StoredCalibration, moment_of

CONFIGURATION = "configuration"
SECONDS_A_DAY = 86400.0


def summary(document: Mapping[str, Any]) -> dict[str, Any]:
    """What a list says of a calibration, from its own document."""
    return {key: document.get(key) for key in ("id", "created_utc", "source", "sigma0_px", "glass", "image")}


def configured_row(document: Mapping[str, Any], device: str) -> dict[str, Any]:
    """A calibration that the configuration names."""
    return _row(document["id"], device, CONFIGURATION) | summary(document)


def stored_row(entry: StoredCalibration) -> dict[str, Any]:
    """A stored calibration; of a damaged one only the id and what is wrong."""
    record = entry.record
    if entry.problem is not None:
        return _row(entry.id, "", None) | {"problem": entry.problem}
    made = {"note": record.note, "capture": record.capture, "stored_utc": record.stored_utc or None}
    return _row(entry.id, record.device, record.origin) | summary(entry.document) | made


def newest_first(row: Mapping[str, Any]) -> tuple[bool, datetime, str]:
    """Sorts rows, in reverse: the newest first, damaged ones last."""
    created = row["created_utc"]
    return created is not None, moment_of(created or "0001-01-01"), str(row["id"])


def age_days(created_utc: str, now: datetime) -> float:
    """Below zero where it was made by a clock ahead of this one."""
    return (now - moment_of(created_utc)).total_seconds() / SECONDS_A_DAY


def _row(calibration_id: str, device: str, origin: str | None) -> dict[str, Any]:
    empty = dict.fromkeys(
        ("created_utc", "source", "sigma0_px", "glass", "image", "capture", "stored_utc", "problem")
    )
    return {"id": calibration_id, "device": device, "origin": origin, "note": "", **empty}
