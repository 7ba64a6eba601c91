"""Calibrations on disk, each in a folder that never changes.

    ID/calibration.json    the document, byte for byte as it was stored
    ID/record.json         device, origin, note, the document's SHA-256
    ID/report.json         the report as a document, if it was made from a capture
    ID/report.html         the report as a page, if it could be drawn

A folder is written under a temporary name, synchronised and renamed, so it exists completely or not at all.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from grabberd import runtime
from grabberd.core.geometry import Calibration
from grabberd.errors import Conflict, InputError, NotFound, StorageError
from grabberd.files.checked_file import check_file, text_check
from grabberd.files.disk import (
    READ_ONLY,
    clear_scratch,
    scratch_folder,
    storage_errors,
    sync_directory,
    write_synced,
)

ID = re.compile(r"[0-9A-Za-z_-]{1,80}")
REMEMBERED, DATES_REMEMBERED = 256, 1 << 16

DOCUMENT, RECORD, REPORT, PAGE = "calibration.json", "record.json", "report.json", "report.html"

Origin = Literal["capture", "import"]


@dataclass(frozen=True, slots=True)
class CalibrationRecord:
    """Record stored beside a calibration.

    Attributes:
        device: Device that it belongs to.
        origin: "capture" if it was made here, "import" otherwise.
        stored_utc: Time when it was stored, ISO 8601.
        note: Note for people.
        capture: Id of the capture it was made from, or None.
        missing_extra: Optional part that was not installed when the report was drawn, or None.
        page_problem: Other reason why the report could not be drawn, or None.
        sha256: SHA-256 of the document, in hexadecimal.
        job: Id of the job that made it, or None.
    """

    device: str = ""
    origin: Origin = "import"
    stored_utc: str = ""
    note: str = ""
    capture: str | None = None
    missing_extra: str | None = None
    page_problem: str | None = None
    sha256: str = ""
    job: str | None = None


@dataclass(frozen=True, slots=True)
class StoredCalibration:
    """One folder of the store; a damaged one has only `id` and `problem`."""

    id: str
    document: Mapping[str, Any] = field(default_factory=dict)
    record: CalibrationRecord = field(default_factory=CalibrationRecord)
    problem: str | None = None


class CalibrationStore:
    """The calibrations in a folder; any thread and process may read and add."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        # Keyed by time and size, too, so that a folder repaired by hand is read again.
        self._read = lru_cache(REMEMBERED)(lambda folder, mtime_ns, size: _read(folder))
        self._created = lru_cache(DATES_REMEMBERED)(lambda folder, mtime_ns, size: _created_utc(folder))

    def open(self) -> None:
        """Creates the folder, and removes unfinished calibrations left by a crash.

        Raises:
            StorageError: The folder cannot be written.
        """
        clear_scratch(self.directory)

    def add(
        self,
        document: Mapping[str, Any],
        record: CalibrationRecord | None = None,
        *,
        report: Mapping[str, Any] | None = None,
        page: str | None = None,
    ) -> Calibration:
        """Stores a calibration durably, completely or not at all.

        Args:
            document: The calibration; its id becomes the folder's name.
            record: Record to be stored beside it; the SHA-256 is filled in here.
            report: Report on how it was made.
            page: The report as HTML.

        Raises:
            InputError: The document is not a calibration, or its id is not a valid folder name.
            Conflict: A calibration with that id already exists.
            StorageError: The calibration cannot be written, or differs when read back.
        """
        calibration = Calibration.from_document(document)
        check_id(calibration.id)
        content = _json(document)
        sha256 = hashlib.sha256(content).hexdigest()
        files = {
            DOCUMENT: content,
            RECORD: _json(asdict(replace(record or CalibrationRecord(), sha256=sha256))),
            REPORT: None if report is None else _json(report),
            PAGE: None if page is None else page.encode(),
        }
        with self.scratch() as scratch, storage_errors(self.directory / calibration.id):
            made = scratch / calibration.id
            _write_folder(made, files)
            _read_back(made, files)
            self._publish(made)
        return calibration

    def scratch(self) -> AbstractContextManager[Path]:
        """A folder beside the calibrations, removed afterwards.

        Raises:
            StorageError: The folder cannot be created.
        """
        with storage_errors(self.directory):
            self.directory.mkdir(parents=True, exist_ok=True)
        return scratch_folder(self.directory)

    def __contains__(self, calibration_id: str) -> bool:
        return ID.fullmatch(calibration_id) is not None and (self.directory / calibration_id).exists()

    def created(self) -> dict[str, str | None]:
        """Times of creation of all calibrations, by id; None for a damaged one."""
        return {name: self._created_utc(name) for name in self._names()}

    def entry(self, calibration_id: str) -> StoredCalibration:
        """One calibration, which may be damaged, or missing by now."""
        try:
            return self._read(*self._version(calibration_id))
        except _UNREADABLE as error:
            return StoredCalibration(calibration_id, problem=f"{getattr(error, 'strerror', None) or error}")

    def get(self, calibration_id: str) -> StoredCalibration:
        """One usable calibration.

        Raises:
            NotFound: No calibration has that id.
            StorageError: The calibration is damaged.
        """
        self._folder(calibration_id)
        entry = self.entry(calibration_id)
        if entry.problem is not None:
            raise StorageError(
                f"calibration {calibration_id} is damaged: {entry.problem}",
                "restore its folder from a backup, or calibrate again",
            )
        return entry

    def made_by(self, job: str) -> str | None:
        """Id of the calibration stored by a job; None if it has stored none."""
        entries = map(self.entry, self._names())
        return next((entry.id for entry in entries if entry.record.job == job), None)

    def content(self, calibration_id: str) -> bytes:
        """The document as it was stored, byte for byte.

        Raises:
            NotFound, StorageError: See `get`.
        """
        self.get(calibration_id)
        with storage_errors(self.directory / calibration_id):
            return (self.directory / calibration_id / DOCUMENT).read_bytes()

    def report(self, calibration_id: str) -> bytes | None:
        """The report as a JSON document; None if there is none.

        Raises:
            NotFound: No calibration has that id.
        """
        return _bytes_of(self._folder(calibration_id) / REPORT)

    def page(self, calibration_id: str) -> bytes | None:
        """The report as HTML; None if there is none.

        Raises:
            NotFound: No calibration has that id.
        """
        return _bytes_of(self._folder(calibration_id) / PAGE)

    def _folder(self, calibration_id: str) -> Path:
        if calibration_id not in self:
            raise NotFound(f"no calibration {calibration_id!r}", "GET /api/v1/calibrations lists all of them")
        return self.directory / calibration_id

    def _names(self) -> list[str]:
        return sorted(path.name for path in self.directory.glob("*") if not path.name.startswith("."))

    def _created_utc(self, name: str) -> str | None:
        try:
            return self._created(*self._version(name))
        except _UNREADABLE:
            return None

    def _version(self, name: str) -> tuple[Path, int, int]:
        stat = (self.directory / name / DOCUMENT).stat()
        return self.directory / name, stat.st_mtime_ns, stat.st_size

    def _publish(self, made: Path) -> None:
        """Renames a finished folder; renaming never replaces a non-empty folder."""
        target = self.directory / made.name
        try:
            runtime.rename(made, target)
        except OSError:
            if not target.exists():
                raise
            raise Conflict(
                f"calibration {made.name} exists already", "a stored calibration is never changed"
            ) from None
        sync_directory(self.directory)


def check_id(calibration_id: str) -> None:
    """Checks that an id can be used as a folder name and in URLs.

    Raises:
        InputError: The id is invalid.
    """
    if not ID.fullmatch(calibration_id):
        raise InputError(
            f"the calibration's id {calibration_id[:100]!r} cannot be used",
            "1 to 80 letters, digits, - and _ make an id",
        )


def moment_of(created_utc: str) -> datetime:
    """The time in a calibration's `created_utc`; UTC if it has no zone."""
    moment = datetime.fromisoformat(created_utc)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


_UNREADABLE = (OSError, ValueError, TypeError, RecursionError, InputError)


def _created_utc(folder: Path) -> str:
    return str(_read(folder).document["created_utc"])


def _read(folder: Path) -> StoredCalibration:
    content = (folder / DOCUMENT).read_bytes()
    record = CalibrationRecord(**json.loads((folder / RECORD).read_bytes()))
    if hashlib.sha256(content).hexdigest() != record.sha256:
        raise ValueError(f"{DOCUMENT} is not what was stored")
    document = json.loads(content)
    calibration = Calibration.from_document(document)
    if calibration.id != folder.name:
        raise ValueError(f"its folder is called {folder.name}, it is {calibration.id}")
    return StoredCalibration(folder.name, document, record)


def _json(document: Mapping[str, Any]) -> bytes:
    try:
        return json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1).encode() + b"\n"
    except ValueError as error:
        raise InputError(
            f"the document cannot be written as JSON: {error}", "fix the value that the message names"
        ) from error


def _write_folder(folder: Path, files: Mapping[str, bytes | None]) -> None:
    folder.mkdir()
    for name, content in files.items():
        if content is not None:
            write_synced(folder / name, content, READ_ONLY)
    sync_directory(folder)


def _read_back(folder: Path, files: Mapping[str, bytes | None]) -> None:
    """Checks a folder as it will be read later: the files, and the calibration as a whole."""
    for name, content in files.items():
        if content is not None:
            check_file(folder / name, text_check(content.decode()), name)
    _read(folder)


def _bytes_of(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None
