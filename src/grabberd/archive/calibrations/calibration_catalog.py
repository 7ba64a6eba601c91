"""The catalog of calibrations, stored and configured, and the frames that come with the program."""

import json
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from grabberd.archive.state.calibration_store import (
    CalibrationRecord,
    CalibrationStore,
    StoredCalibration,
    moment_of,
)
from grabberd.config import shipped_configs
from grabberd.core.geometry import Reading
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.object_model import FileKey
from grabberd.documents.calibrations import (
    ActiveCalibration,
    CalibrationFrameRow,
    CalibrationRow,
    UnusableFrame,
)
from grabberd.documents.document import JsonObject
from grabberd.errors import Conflict, ExtraMissing, GrabberdError, InputError, NotFound
from grabberd.files.reading import read_yaml

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


class CalibrationHead(NamedTuple):
    """A calibration as far as lists are sorted by it.

    Attributes:
        id: Its id.
        created_utc: When it was created; None for a damaged one.
        device: The device in whose configuration it is; None for a stored one.
    """

    id: str
    created_utc: str | None
    device: str | None = None

    @property
    def place(self) -> tuple[str, str]:
        """Its place in a list."""
        return self.created_utc or "", self.id


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

    def heads(self) -> list[CalibrationHead]:
        """Returns the heads of all calibrations, newest first, damaged ones last."""
        stored = [CalibrationHead(*known) for known in self.store.created().items()]
        # A calibration that is both configured and stored is listed once, with its record.
        configured = [
            CalibrationHead(document["id"], document["created_utc"], device)
            for device, document in self.configured.items()
            if not self._is_stored(document)
        ]
        return sorted([*stored, *configured], key=_newest_first, reverse=True)

    def row(self, head: CalibrationHead) -> CalibrationRow:
        """Returns the row of a calibration."""
        if head.device is not None:
            document = self.configured[head.device]
            return _row(head.id, document, device=head.device, origin=CONFIGURATION)
        row = stored_row(self.store.entry(head.id))
        configured = self._configured(head.id)
        hidden = configured is not None and not self._is_stored(configured)
        return row.model_copy(update={"problem": row.problem or HIDDEN}) if hidden else row

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

    def _is_stored(self, document: Document) -> bool:
        return self.store.entry(document["id"]).document == document

    def _beside(self, calibration_id: str, read: Callable[[str], bytes | None]) -> bytes | None:
        """Reads a file stored beside a calibration; None if the calibration is only configured."""
        if self._configured(calibration_id) and calibration_id not in self.store:
            return None
        return read(calibration_id)


def _newest_first(head: CalibrationHead) -> tuple[bool, datetime, str]:
    return head.created_utc is not None, moment_of(head.created_utc or "0001-01-01"), head.id


def _no_page(calibration_id: str, record: CalibrationRecord) -> GrabberdError:
    what = f"the report of calibration {calibration_id} as a page"
    if record.missing_extra is None:
        hint = "its numbers are in report.json beside it; please report this"
        return NotFound(f"{what} could not be drawn: {record.page_problem}", hint)
    error = ExtraMissing(what, record.missing_extra)
    error.hint += " and recalibrate; its numbers are in report.json beside it"
    return error


CALIBRATION_FRAME_KEYS: Mapping[str, FileKey] = MappingProxyType(
    {
        "certificate": FileKey(
            "anything",
            "",
            "none",
            "Number, laboratory, date; stored with every calibration and shown in its report.",
        ),
        "temperature_C": FileKey(
            "number", "°C", "none", "Temperature at which they were measured; stored and shown likewise."
        ),
        "check_length": FileKey(
            "mapping",
            "",
            "none",
            "Distance between two targets, certified independently of the positions: only this reveals a "
            "file whose scale is wrong.",
        ),
    }
)
"""Additional keys of a calibration frame's document, compared with an object model."""


FRAMES_FOLDER = "calibration-frames"


def known_calibration_frames(config_file: Path | None = None) -> dict[str, Path]:
    """Returns the files in `calibration-frames`, by name without suffix: those beside the configuration file,
    or if there are none, those that come with the program.
    """
    own = config_file.parent if config_file else shipped_configs()
    return _files(own) or _files(shipped_configs())


def _files(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted((folder / FRAMES_FOLDER).glob("*.yaml"))}


def frame_row(name: str, path: Path) -> CalibrationFrameRow | UnusableFrame:
    """A known calibration frame, or what is wrong with its file."""
    try:
        return _frame_row(name, path, path.stat().st_mtime_ns)
    except OSError as error:
        problem = f"{path} cannot be read: {error.strerror}"
        return UnusableFrame(name=name, problem=problem, hint="let the daemon's user read it, or remove it")
    except InputError as error:
        return UnusableFrame(name=name, problem=error.message, hint=error.hint)


@lru_cache(256)
def _frame_row(name: str, path: Path, _changed_ns: int) -> CalibrationFrameRow:
    """The distinguishing properties; cached until the file changes."""
    model = calibration_frame_model(read_yaml(path), str(path))
    sizes = np.ptp(model.xyz_mm[:, :2], axis=0).round(1).tolist()
    return CalibrationFrameRow(
        name=name,
        targets=len(model),
        target_diameter_mm=model.target_diameter_mm,
        size_mm=sorted(sizes, reverse=True),
    )


def calibration_frame_document(
    wanted: str | JsonObject | None, config_file: Path | None = None
) -> JsonObject:
    """Returns a calibration frame's document: as given, by name, or the only one there is.

    Raises:
        NotFound: No calibration frame has that name, or a name is needed.
        InputError: The file cannot be read.
    """
    if isinstance(wanted, Mapping):
        return dict(wanted)
    # The name may come from a client: it is looked up, never made part of a path.
    known = known_calibration_frames(config_file)
    if wanted is None and len(known) == 1:
        return read_yaml(next(iter(known.values())))
    name = (wanted or "").removesuffix(".yaml")
    named = _files(shipped_configs()) | known
    if name not in named:
        problem = "no calibration frame is named" if wanted is None else f"no calibration frame {wanted!r}"
        names = ", ".join(known) or "none is installed"
        raise NotFound(problem, f"name one of: {names}; or give its document, with its targets")
    return read_yaml(named[name])


def calibration_frame_model(document: JsonObject, what: str = "the calibration frame's file") -> ObjectModel:
    """Returns the targets of a calibration frame's document.

    Args:
        document: The content of the file.
        what: How a refusal calls it.

    Raises:
        InputError: The document is invalid.
    """
    reading = Reading(what)
    if document.get("temperature_C") is not None:
        reading.number(document, "temperature_C")
    reading.finish("give the temperature at which the positions were measured in °C, or leave the key out")
    own = {key: document[key] for key in document if key not in CALIBRATION_FRAME_KEYS}
    return ObjectModel.from_document(own, what)
