"""The tables of a capture file; creating and opening it."""

import json
import os
import sqlite3
import typing
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

from grabberd.errors import CaptureFileError, LaterVersion, StorageError
from grabberd.storage.disk import storage_errors

APPLICATION_ID = 0x67726162
"""The letters `grab` in the database's header: tells a capture from other SQLite files."""
VERSION = 1

PART = ".part"
"""Ending of a capture's name until it is sealed."""
SUFFIX = ".grab"
"""Ending of a sealed capture's name."""
DAMAGED = "damaged"
"""Folder beside the captures for those that cannot be read."""

TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE fields (
    n INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, sequence INTEGER, parity INTEGER NOT NULL,
    y0 INTEGER NOT NULL, y_step INTEGER NOT NULL, rows INTEGER NOT NULL, columns INTEGER NOT NULL,
    bits INTEGER NOT NULL, threshold INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT,
    codec TEXT NOT NULL, data BLOB NOT NULL);
CREATE TABLE ledger (
    first_n INTEGER PRIMARY KEY, count INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT NOT NULL);
CREATE TABLE runs (
    run INTEGER PRIMARY KEY, kind TEXT NOT NULL, created_utc TEXT NOT NULL, version TEXT NOT NULL,
    state TEXT NOT NULL, reason TEXT, calibration TEXT NOT NULL, object TEXT NOT NULL,
    settings TEXT NOT NULL);
CREATE TABLE points (
    run INTEGER NOT NULL, n INTEGER NOT NULL, count INTEGER NOT NULL, data BLOB NOT NULL,
    PRIMARY KEY (run, n)) WITHOUT ROWID;
CREATE TABLE reserve (data BLOB NOT NULL);
"""
# Errors that may pass while the file is sound; all others mean that it is damaged.
_NOT_THE_FILES_FAULT = (
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_FULL,
)
DAMAGE = (ValueError, TypeError, KeyError, OverflowError)
"""Exceptions that damaged content raises where it is decoded."""
RESERVE_BYTES = 256 * 1024
"""Size of the table `reserve`, which is filled at the start and emptied at the end: its pages hold the
ledger and the verdict if the disk is full to the last byte by then."""
JOURNAL = "-journal"
JOURNAL_BYTES = 256 * 1024
"""Size of the journal from the start: the sealing transaction must not need to extend it either."""
RECORDING = "recording"
SEALED = "sealed"


def create(path: Path, max_pages: int | None = None) -> sqlite3.Connection:
    """Creates a capture file; `max_pages` limits its size, for tests of a full disk.

    Raises:
        StorageError: It exists, or cannot be written.
    """
    with storage_errors(path):
        for taken in (path, sealed_path(path)):
            if taken.exists():
                raise StorageError(f"{taken} exists already", "give the capture another name")
        # isolation_level None leaves transactions to the writer, which commits twice a second and never by
        # itself; it is made on one thread and used on another, never on two at once.
        connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        # Not WAL: a copy without its log would be empty, and sealing would fail while somebody reads. PERSIST
        # keeps the journal between commits, since a full disk has no room for a new one.
        connection.execute("PRAGMA journal_mode = PERSIST")
        connection.execute("PRAGMA synchronous = FULL")  # a power cut costs no commit that returned
        connection.execute("PRAGMA busy_timeout = 10000")
        # Overwriting the freed reserve with zeros would journal all of its pages first.
        connection.execute("PRAGMA secure_delete = OFF")
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")
        if max_pages is not None:
            connection.execute(f"PRAGMA max_page_count = {max_pages:d}")
        # One transaction: a kill leaves a file with all of its tables, or an empty one.
        connection.executescript("BEGIN;" + TABLES)
        connection.execute("INSERT INTO reserve VALUES (zeroblob(?))", (RESERVE_BYTES,))
        connection.execute("COMMIT")
        _reserve_journal(path.with_name(path.name + JOURNAL))
        return connection


def _reserve_journal(journal: Path) -> None:
    """Extends the journal; SQLite ignores what lies beyond the end that its header states."""
    with journal.open("r+b") as file:
        os.posix_fallocate(file.fileno(), 0, JOURNAL_BYTES)


def part_path(folder: Path, capture_id: str) -> Path:
    """Path of a new capture's file while it is written: `ID.grab.part`."""
    return folder / f"{capture_id}{SUFFIX}{PART}"


def sealed_path(part: Path) -> Path:
    """`NAME.grab` for `NAME.grab.part`; a name without that ending stays as it is."""
    return part.with_name(part.name.removesuffix(PART))


def connect(path: Path, *, writable: bool = False) -> sqlite3.Connection:
    """Opens an existing capture file and checks that it is one.

    Raises:
        CaptureFileError: It is missing, no capture, damaged, or of a later version.
        StorageError: The disk or another program prevents reading it.
    """
    # Without the mode, SQLite would create an empty file in place of one that is being renamed just now.
    uri = f"{path.absolute().as_uri()}?mode=rw"
    with reading_errors(path):
        # The parts of a download are read one after another, each by whichever pool thread is free.
        connection = sqlite3.connect(
            uri, uri=True, isolation_level=None, timeout=10.0, check_same_thread=False
        )
        try:
            connection.execute("PRAGMA synchronous = FULL")
            if not writable:
                connection.execute("PRAGMA query_only = ON")
            _check(connection, path)
        except BaseException:
            connection.close()
            raise
    return connection


def _check(connection: sqlite3.Connection, path: Path) -> None:
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if application != APPLICATION_ID:
        raise CaptureFileError(f"{path} is a database, but no capture", "choose a file that grabberd wrote")
    if version > VERSION:
        raise LaterVersion(
            f"{path} has version {version}, this program reads up to {VERSION}", "use a newer grabberd"
        )


def _damaged(path: Path, error: Exception) -> CaptureFileError:
    return CaptureFileError(
        f"{path} cannot be read as a capture: {error}",
        "if it was copied, copy it again; the sqlite3 program's .recover may save what is left",
    )


@contextmanager
def reading_errors(path: Path) -> Iterator[None]:
    """Turns damaged content into `CaptureFileError`, a broken disk or a lock into `StorageError`."""
    try:
        yield
    except sqlite3.DatabaseError as error:
        if not path.is_file():
            hint = "check the name; a running capture ends in .grab.part"
            raise CaptureFileError(f"no capture file {path}", hint) from error
        if _primary_code(error) in _NOT_THE_FILES_FAULT:
            hint = "check whether another program has it open, and whether the disk is sound"
            raise StorageError(f"{path} cannot be read now: {error}", hint) from error
        raise _damaged(path, error) from error
    except DAMAGE as error:
        raise _damaged(path, error) from error


def _primary_code(error: sqlite3.Error) -> int:
    """The low byte of SQLite's code; errors raised by the Python module itself have none."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF


@dataclass(frozen=True, slots=True)
class CaptureMeta:
    """The table `meta`, which has a JSON value for each key.

    Attributes:
        id: Id of the capture.
        created_utc: Moment of the request, ISO 8601.
        start_ns: The same moment by CLOCK_MONOTONIC.
        device: Name, driver, options and, as `stream`, what the driver granted.
        config: The device's part of the configuration.
        site: Site of the configuration, e.g. the barn.
        labels: The operator's labels.
        note: The operator's note.
        bits: Bits per pixel.
        lines: "doubled" or "field".
        rate_hz: Nominal fields per second.
        version: Version of the program that wrote it.
        state: "recording", then "sealed".
        boot_id: The kernel's id of the start of the computer that `start_ns` and the fields' times count
            from; empty if it is unknown.
        complete: None while recording, then True if nothing is lost or damaged.
        ended_because: Reason why it ended.
        extra: Further findings; see docs/reference/capture-file.md.
    """

    id: str
    created_utc: str
    start_ns: int
    device: Mapping[str, Any]
    config: Mapping[str, Any]
    site: Mapping[str, str]
    labels: Mapping[str, str]
    note: str
    bits: int
    lines: str
    rate_hz: float
    version: str
    boot_id: str = ""
    state: str = RECORDING
    complete: bool | None = None
    ended_because: str | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)


_KINDS = {
    name: typing.get_origin(kind) or kind for name, kind in typing.get_type_hints(CaptureMeta).items()
} | {"rate_hz": int | float, "complete": bool | None, "ended_because": str | None}


def write_meta(connection: sqlite3.Connection, values: Mapping[str, Any]) -> None:
    """Writes some keys within the caller's transaction."""
    rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows)


def coverage_key(run: int) -> str:
    """Key of a run's coverage in the table `meta`, where earlier versions ignore what they do not know."""
    return f"coverage.{run}"


def read_coverage(connection: sqlite3.Connection) -> dict[str, str]:
    """The coverage of runs as JSON, by their keys."""
    rows = connection.execute("SELECT key, value FROM meta WHERE key GLOB 'coverage.*'")
    return dict(rows.fetchall())


def read_meta(connection: sqlite3.Connection) -> CaptureMeta:
    """Reads the metadata of a file; a key newer than the file has its default.

    Raises:
        KeyError: A key without a default is missing.
        ValueError: A value has the wrong type.
    """
    stored = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM meta")}
    optional = {f.name for f in fields(CaptureMeta) if not (f.default is f.default_factory is MISSING)}
    names = [f.name for f in fields(CaptureMeta) if f.name in stored or f.name not in optional]
    for name in names:
        if not isinstance(stored[name], _KINDS[name]):
            raise ValueError(f"{name} is {stored[name]!r}")
    if not isinstance(stored["device"].get("name"), str):
        raise ValueError(f"device is {stored['device']!r}, without a name")
    return CaptureMeta(**{name: stored[name] for name in names})
