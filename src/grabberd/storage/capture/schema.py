"""The tables of a capture file, and how it is opened."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grabberd.errors import CaptureFileError, LaterVersion, StorageError
from grabberd.storage.disk import storage_errors

APPLICATION_ID = 0x67726162
"""The letters `grab` in the database's header, by which `file` and we know a capture."""
VERSION = 1

PART = ".part"
"""What a capture's name ends with until it is sealed."""
SUFFIX = ".grab"
"""What a sealed capture's name ends with."""
DAMAGED = "damaged"
"""The folder beside the captures where those are put that cannot be read."""

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
_NOT_THE_FILES_FAULT = (
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_FULL,
)
DAMAGE = (ValueError, TypeError, KeyError, OverflowError)
"""What damaged content leads to, where it is taken for what it should be."""
RESERVE_BYTES = 256 * 1024
"""Set aside at the start and given back at the end, so that a full disk still lets a capture be sealed."""
JOURNAL = "-journal"
JOURNAL_BYTES = 256 * 1024
"""Of the journal, for the same reason."""


def create(path: Path, max_pages: int | None = None) -> sqlite3.Connection:
    """A new capture file; `max_pages` limits its size, for tests of a full disk.

    Raises:
        StorageError: it exists, or cannot be written.
    """
    with storage_errors(path):
        for taken in (path, sealed_path(path)):
            if taken.exists():
                raise StorageError(f"{taken} exists already", "give the capture another name")
        connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        connection.execute("PRAGMA journal_mode = PERSIST")  # a full disk has no room for another journal
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA busy_timeout = 10000")
        # Overwriting what is freed would need room in the journal for all of the reserve.
        connection.execute("PRAGMA secure_delete = OFF")
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")
        if max_pages is not None:
            connection.execute(f"PRAGMA max_page_count = {max_pages:d}")
        connection.executescript("BEGIN;" + TABLES)
        connection.execute("INSERT INTO reserve VALUES (zeroblob(?))", (RESERVE_BYTES,))
        connection.execute("COMMIT")
        _reserve_journal(path.with_name(path.name + JOURNAL))
        return connection


def _reserve_journal(journal: Path) -> None:
    """Room for the journal of the transaction that seals; SQLite does not mind what lies behind its end."""
    with journal.open("r+b") as file:
        os.posix_fallocate(file.fileno(), 0, JOURNAL_BYTES)


def sealed_path(part: Path) -> Path:
    """`NAME.grab` for `NAME.grab.part`; a name without that ending stays as it is."""
    return part.with_name(part.name.removesuffix(PART))


def connect(path: Path, *, writable: bool = False) -> sqlite3.Connection:
    """An existing capture file, checked to be one.

    Raises:
        CaptureFileError: it is missing, no capture, damaged, or of a later version.
        StorageError: the disk or another program keeps it from being read.
    """
    # Without the mode SQLite would make an empty file of one that is being renamed at this moment.
    uri = f"{path.absolute().as_uri()}?mode=rw"
    with reading_errors(path):
        # The pieces of a download are read one after the other, each by whichever thread is free.
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
        raise CaptureFileError(f"{path} is a database, but no capture", "name a file that grabberd wrote")
    if version > VERSION:
        raise LaterVersion(
            f"{path} is of version {version}, this program reads up to {VERSION}", "use a newer grabberd"
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
            hint = "see whether another program holds it, and mend the disk"
            raise StorageError(f"{path} cannot be read now: {error}", hint) from error
        raise _damaged(path, error) from error
    except DAMAGE as error:
        raise _damaged(path, error) from error


def _primary_code(error: sqlite3.Error) -> int:
    """The low byte; an error of the Python module itself has none."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF
