"""The catalog of calibrations, stored and configured, and their rows in lists."""

import json
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from grabberd.archive.state.calibration_store import (
    CalibrationRecord,
    CalibrationStore,
    StoredCalibration,
    moment_of,
)
from grabberd.documents.calibrations import ActiveCalibration, CalibrationRow
from grabberd.documents.document import JsonObject
from grabberd.errors import Conflict, ExtraMissing, GrabberdError, NotFound

Document = Mapping[str, Any]
"""A calibration as stored in its file."""
CONFIGURATION = "configuration"
FAILED = "failed"
_VERDICTS = ("passed", "passed_with_remarks", FAILED)
SECONDS_A_DAY = 86400.0
_OF_THE_DOCUMENT = ("created_utc", "source", "sigma0_px", "glass", "image")


def stored_row(entry: StoredCalibration) -> CalibrationRow:
    """A stored calibration; a damaged one has only its id and the problem."""
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
    """Sort key for descending order: newest first, damaged ones last."""
    return row.created_utc is not None, moment_of(row.created_utc or "0001-01-01"), row.id


def age_days(created_utc: str, now: datetime) -> float:
    """Age in days; negative if the clock that dated the calibration was ahead of this one."""
    return (now - moment_of(created_utc)).total_seconds() / SECONDS_A_DAY


def acceptance_of(document: Document) -> JsonObject | None:
    """The acceptance in a calibration's document; None if it was not assessed."""
    details = document.get("details")
    found = details.get("acceptance") if isinstance(details, Mapping) else None
    return dict(found) if isinstance(found, Mapping) and found.get("verdict") in _VERDICTS else None


def verdict_of(document: Document) -> str | None:
    """The verdict in a calibration's document; None if it was not assessed."""
    return (acceptance_of(document) or {}).get("verdict")


def failure_of(document: Document) -> str | None:
    """The reasons why a calibration failed, in a sentence; None if it did not."""
    if verdict_of(document) != FAILED:
        return None
    reasons = (acceptance_of(document) or {}).get("reasons") or []
    said = [str(one.get("message")) for one in reasons if one.get("level") == FAILED]
    return f"the acceptance of calibration {document.get('id')} failed: {'; '.join(said) or 'see its report'}"


def _row(calibration_id: str, document: Document, **known: str | None) -> CalibrationRow:
    """A row from a document and a record; `active`, `misfit` and `rejected` are filled in later."""
    row: JsonObject = dict.fromkeys(CalibrationRow.model_fields)
    row |= {"id": calibration_id, "device": "", "note": "", "active": False}
    row |= {key: document.get(key) for key in _OF_THE_DOCUMENT}
    row["verdict"] = verdict_of(document)
    return CalibrationRow.model_validate(row | known)


HIDDEN = "the configuration has another calibration of this id, which takes precedence"


class CalibrationCatalog:
    """Finds calibrations by id; configured ones take precedence over stored ones.

    Args:
        directory: Folder of the stored calibrations; nothing is written before `open`.
        configured: The configuration's calibration documents, by device.

    Attributes:
        store: The stored calibrations.
        configured: As given.
    """

    def __init__(self, directory: Path, configured: Mapping[str, Document]) -> None:
        self.store = CalibrationStore(directory)
        self.configured = dict(configured)

    def rows(self) -> list[CalibrationRow]:
        """Returns the rows of all calibrations, newest first, damaged ones last."""
        stored = self.store.list()
        # A calibration that is both configured and stored is listed once, with its record.
        also_stored = {entry.id for entry in stored if entry.document in self.configured.values()}
        rows = [self._stored_row(entry, entry.id in also_stored) for entry in stored]
        rows += [
            _row(document["id"], document, device=device, origin=CONFIGURATION)
            for device, document in self.configured.items()
            if document["id"] not in also_stored
        ]
        return sorted(rows, key=newest_first, reverse=True)

    def find(self, calibration_id: str) -> Document:
        """Returns the document of a calibration.

        Raises:
            NotFound: No calibration has that id.
            StorageError: The calibration is damaged.
        """
        return self._configured(calibration_id) or self.store.get(calibration_id).document

    def content(self, calibration_id: str) -> bytes:
        """Returns the document as JSON, byte for byte as it was stored.

        Raises:
            NotFound, StorageError: See `find`.
        """
        configured = self._configured(calibration_id)
        if configured is None:
            return self.store.content(calibration_id)
        return json.dumps(configured, ensure_ascii=False, indent=1).encode() + b"\n"

    def owners(self, calibration_id: str) -> set[str]:
        """Returns the devices that a calibration belongs to."""
        owners = {device for device, document in self.configured.items() if document["id"] == calibration_id}
        return owners or {self.store.get(calibration_id).record.device}

    def report(self, calibration_id: str) -> bytes:
        """Returns the report as a JSON document.

        Raises:
            NotFound: The calibration does not exist, or has no report.
        """
        report = self._beside(calibration_id, self.store.report)
        if report is None:
            raise NotFound(
                f"calibration {calibration_id} has no report",
                "only calibrations made here from a capture have one",
            )
        return report

    def page(self, calibration_id: str) -> bytes:
        """Returns the report as HTML.

        Raises:
            NotFound: The calibration does not exist, has no report, or the report could not be drawn.
            ExtraMissing: matplotlib was not installed when the calibration was made.
        """
        page = self._beside(calibration_id, self.store.page)
        if page is None:
            self.report(calibration_id)
            raise _no_page(calibration_id, self.store.get(calibration_id).record)
        return page

    def add(self, document: Document, record: CalibrationRecord) -> str:
        """Stores a complete calibration and returns its id.

        Raises:
            InputError: The document is invalid.
            Conflict: The id is taken.
        """
        calibration_id = str(document.get("id"))
        if self._configured(calibration_id):
            raise Conflict(
                f"the configuration already has a calibration {calibration_id}",
                "use that one; a calibration is never changed",
            )
        return self.store.add(document, record).id

    def _configured(self, calibration_id: str) -> Document | None:
        found = (document for document in self.configured.values() if document["id"] == calibration_id)
        return next(found, None)

    def _stored_row(self, entry: StoredCalibration, also_configured: bool) -> CalibrationRow:
        row = stored_row(entry)
        hidden = self._configured(entry.id) is not None and not also_configured
        return row.model_copy(update={"problem": row.problem or HIDDEN}) if hidden else row

    def _beside(self, calibration_id: str, read: Callable[[str], bytes | None]) -> bytes | None:
        """Reads a file stored beside a calibration; None if the calibration is only configured."""
        if self._configured(calibration_id) and calibration_id not in self.store:
            return None
        return read(calibration_id)


def _no_page(calibration_id: str, record: CalibrationRecord) -> GrabberdError:
    what = f"the report of calibration {calibration_id} as a page"
    if record.missing_extra is None:
        hint = "its numbers are in report.json beside it; please report this"
        return NotFound(f"{what} could not be drawn: {record.page_problem}", hint)
    error = ExtraMissing(what, record.missing_extra)
    error.hint += " and recalibrate; its numbers are in report.json beside it"
    return error
