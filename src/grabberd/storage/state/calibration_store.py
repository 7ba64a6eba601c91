"""Calibrations on disk: a folder each, which nothing changes once it is there.

    ID/calibration.json    the document, byte for byte as it was stored
    ID/record.json         device, origin, note, the document's SHA-256
    ID/report.json         the report as a document, of those made from a capture
    ID/report.html         the report as a page, where it could be drawn

A folder is written under another name, synchronised and renamed, so it is there whole or not at all.
"""

import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from grabberd.errors import Conflict, InputError, NotFound, StorageError
from grabberd.geometry import Calibration
from grabberd.storage.disk import storage_errors

ID = re.compile(r"[0-9A-Za-z_-]{1,80}")
READ_ONLY = 0o444
SCRATCH = ".part-"
REMEMBERED = 256

DOCUMENT, RECORD, REPORT, PAGE = "calibration.json", "record.json", "report.json", "report.html"

Origin = Literal["capture", "import"]


@dataclass(frozen=True, slots=True)
class CalibrationRecord:
    """What is kept beside a calibration.

    Attributes:
        device: whose calibration it is; `origin`: made here from a capture, or imported.
        stored_utc: ISO 8601.
        note: for people.
        capture: id of the capture it was made from, or None.
        missing_extra: the optional part that was not installed when the report was to be drawn, or None.
        page_problem: why else it could not be drawn, or None.
        sha256: of the document, in hexadecimal.
    """

    device: str = ""
    origin: Origin = "import"
    stored_utc: str = ""
    note: str = ""
    capture: str | None = None
    missing_extra: str | None = None
    page_problem: str | None = None
    sha256: str = ""


@dataclass(frozen=True, slots=True)
class StoredCalibration:
    """One folder of the store; of a damaged one only `id` and `problem` are known, and nothing is in it."""

    id: str
    document: Mapping[str, Any] = field(default_factory=dict)
    record: CalibrationRecord = field(default_factory=CalibrationRecord)
    problem: str | None = None


class CalibrationStore:
    """The calibrations in a folder; any thread and process may read and add."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        # Remembered as long as a file does not change: nothing here is meant to.
        self._read = lru_cache(REMEMBERED)(lambda folder, mtime_ns, size: _read(folder))

    def open(self) -> None:
        """Makes the folder, and clears away what a crash left unfinished.

        Raises:
            StorageError: it cannot be written.
        """
        with storage_errors(self.directory):
            self.directory.mkdir(parents=True, exist_ok=True)
            for left in self.directory.glob(f"{SCRATCH}*"):
                shutil.rmtree(left)

    def add(
        self,
        document: Mapping[str, Any],
        record: CalibrationRecord | None = None,
        *,
        report: Mapping[str, Any] | None = None,
        page: str | None = None,
    ) -> Calibration:
        """Stores a calibration for good, whole or not at all.

        Args:
            document: the calibration; its id becomes the folder's name.
            record: what else is known of it; the SHA-256 is filled in here.
            report: how it was made.
            page: the same as HTML.

        Raises:
            InputError: it is no calibration, or its id is no name for a folder.
            Conflict: there is one of that id.
            StorageError: it cannot be written.
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
            self._publish(made)
        return calibration

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A folder beside the calibrations that is gone afterwards.

        Raises:
            StorageError: it cannot be made.
        """
        with storage_errors(self.directory):
            self.directory.mkdir(parents=True, exist_ok=True)
            scratch = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=self.directory))
        try:
            yield scratch
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def __contains__(self, calibration_id: str) -> bool:
        return ID.fullmatch(calibration_id) is not None and (self.directory / calibration_id).exists()

    def list(self) -> list[StoredCalibration]:
        """All calibrations, the newest first, the damaged ones last."""
        names = sorted(path.name for path in self.directory.glob("*") if not path.name.startswith("."))
        return sorted(map(self._entry, names), key=_age_order, reverse=True)

    def get(self, calibration_id: str) -> StoredCalibration:
        """One calibration that can be used.

        Raises:
            NotFound: there is none of that id.
            StorageError: it is damaged.
        """
        self._folder(calibration_id)
        entry = self._entry(calibration_id)
        if entry.problem is not None:
            raise StorageError(
                f"calibration {calibration_id} is damaged: {entry.problem}",
                "put its folder back from a backup, or calibrate again",
            )
        return entry

    def content(self, calibration_id: str) -> bytes:
        """The document as it was stored, byte for byte.

        Raises:
            NotFound, StorageError: see `get`.
        """
        self.get(calibration_id)
        with storage_errors(self.directory / calibration_id):
            return (self.directory / calibration_id / DOCUMENT).read_bytes()

    def report(self, calibration_id: str) -> bytes | None:
        """The report as a JSON document; None where there is none.

        Raises:
            NotFound: there is no calibration of that id.
        """
        return _bytes_of(self._folder(calibration_id) / REPORT)

    def page(self, calibration_id: str) -> bytes | None:
        """The report as HTML; None where there is none.

        Raises:
            NotFound: there is no calibration of that id.
        """
        return _bytes_of(self._folder(calibration_id) / PAGE)

    def _folder(self, calibration_id: str) -> Path:
        if calibration_id not in self:
            raise NotFound(
                f"no calibration {calibration_id!r}", "GET /api/v1/calibrations lists the ones there are"
            )
        return self.directory / calibration_id

    def _entry(self, name: str) -> StoredCalibration:
        folder = self.directory / name
        try:
            stat = (folder / DOCUMENT).stat()
            return self._read(folder, stat.st_mtime_ns, stat.st_size)
        except (OSError, ValueError, TypeError, RecursionError, InputError) as error:
            return StoredCalibration(name, problem=f"{getattr(error, 'strerror', None) or error}")

    def _publish(self, made: Path) -> None:
        """A rename never replaces a folder that has anything in it."""
        target = self.directory / made.name
        try:
            made.rename(target)
        except OSError:
            if not target.exists():
                raise
            raise Conflict(
                f"there is a calibration {made.name} already", "a stored calibration is never changed"
            ) from None
        _synchronise(self.directory)


def check_id(calibration_id: str) -> None:
    """Whether it can be the name of a folder and a part of an address.

    Raises:
        InputError: it cannot.
    """
    if not ID.fullmatch(calibration_id):
        raise InputError(
            f"the calibration's id {calibration_id[:100]!r} cannot be used",
            "1 to 80 letters, digits, - and _ make an id",
        )


def moment_of(created_utc: str) -> datetime:
    """The time in a calibration's `created_utc`; UTC where it names no zone."""
    moment = datetime.fromisoformat(created_utc)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _age_order(entry: StoredCalibration) -> tuple[bool, datetime]:
    return entry.problem is None, moment_of(entry.document.get("created_utc", "0001-01-01"))


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
        raise InputError(f"the document is no JSON: {error}", "mend the value that is meant") from error


def _write_folder(folder: Path, files: Mapping[str, bytes | None]) -> None:
    folder.mkdir()
    for name, content in files.items():
        if content is not None:
            descriptor = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, READ_ONLY)
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
    _synchronise(folder)


def _synchronise(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _bytes_of(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None
