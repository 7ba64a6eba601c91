"""The tables of a capture file; creating and opening such a file."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from grabberd.archive.guarded_database import JOURNAL, GuardedConnection, open_tables, read_header
from grabberd.errors import NO_PERMISSION, CaptureFileError, LaterVersion, StorageError
from grabberd.files import disk
from grabberd.files.disk import storage_errors
from grabberd.files.reading import check_patience

APPLICATION_ID = 0x67726162
"""The letters `grab` in the database's header, which distinguish captures from other SQLite files."""
FORMAT_1, VERSION, WITH_CHANNELS = 1, 2, 3
"""The first layout, with a row for each field, which is still read; the current one; and the current one with
two further tables, for captures with channels."""

PART = ".part"
"""Suffix of a capture's name until it is sealed."""
SUFFIX = ".grab"
"""Suffix of a sealed capture's name."""
DAMAGED = "damaged"
"""Folder beside the captures for unreadable ones."""

_META = "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
_LEDGER_AND_RUNS = """
CREATE TABLE ledger (
    first_n INTEGER PRIMARY KEY, count INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT NOT NULL);
CREATE TABLE runs (
    run INTEGER PRIMARY KEY, kind TEXT NOT NULL, created_utc TEXT NOT NULL, version TEXT NOT NULL,
    state TEXT NOT NULL, reason TEXT, calibration TEXT NOT NULL, object TEXT NOT NULL,
    settings TEXT NOT NULL);
"""
_RESERVE = "CREATE TABLE reserve (data BLOB NOT NULL);"
TABLES_1 = f"""
{_META}
CREATE TABLE fields (
    n INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, sequence INTEGER, parity INTEGER NOT NULL,
    y0 INTEGER NOT NULL, y_step INTEGER NOT NULL, rows INTEGER NOT NULL, columns INTEGER NOT NULL,
    bits INTEGER NOT NULL, threshold INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT,
    codec TEXT NOT NULL, data BLOB NOT NULL);
{_LEDGER_AND_RUNS}
CREATE TABLE points (
    run INTEGER NOT NULL, n INTEGER NOT NULL, count INTEGER NOT NULL, data BLOB NOT NULL,
    PRIMARY KEY (run, n)) WITHOUT ROWID;
{_RESERVE}
"""
TABLES = f"""
{_META}
CREATE TABLE fields (
    n INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, sequence INTEGER, parity INTEGER NOT NULL,
    y0 INTEGER NOT NULL, y_step INTEGER NOT NULL, threshold INTEGER NOT NULL, outcome TEXT NOT NULL,
    reason TEXT);
CREATE TABLE pictures (
    first_n INTEGER PRIMARY KEY, last_n INTEGER NOT NULL, fields INTEGER NOT NULL, rows INTEGER NOT NULL,
    columns INTEGER NOT NULL, bits INTEGER NOT NULL, data BLOB NOT NULL);
{_LEDGER_AND_RUNS}
CREATE TABLE points (
    run INTEGER NOT NULL, first_n INTEGER NOT NULL, last_n INTEGER NOT NULL, fields INTEGER NOT NULL,
    points INTEGER NOT NULL, field_n BLOB NOT NULL, field_points BLOB NOT NULL, exact TEXT NOT NULL,
    target BLOB NOT NULL, xyz_mm BLOB NOT NULL, covariance_mm2 BLOB NOT NULL,
    calibration_covariance_mm2 BLOB NOT NULL, image_px BLOB NOT NULL, residual_px BLOB NOT NULL,
    PRIMARY KEY (run, first_n));
{_RESERVE}
"""
TABLES_WITH_CHANNELS = f"""
{TABLES}
CREATE TABLE channels (
    channel INTEGER PRIMARY KEY, name TEXT NOT NULL, quantity TEXT NOT NULL, logger TEXT NOT NULL,
    calibration TEXT NOT NULL, source TEXT NOT NULL);
CREATE TABLE readings (
    channel INTEGER NOT NULL, number INTEGER NOT NULL, readings INTEGER NOT NULL, first_ns INTEGER NOT NULL,
    last_ns INTEGER NOT NULL, dating TEXT NOT NULL, time_sigma_ns INTEGER NOT NULL, time_ns BLOB NOT NULL,
    value BLOB NOT NULL, PRIMARY KEY (channel, number));
"""
_TABLES = {FORMAT_1: TABLES_1, VERSION: TABLES, WITH_CHANNELS: TABLES_WITH_CHANNELS}
# Errors that may be temporary; all others mean that the file is damaged.
_NOT_THE_FILES_FAULT = (
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_FULL,
)
DAMAGE = (ValueError, TypeError, KeyError, OverflowError, AttributeError, RecursionError)
"""Exceptions raised when damaged content is decoded."""
_READABLE = "check whether another program has it open, whether it may be read, and whether the disk is sound"
_UNFINISHED = "if nobody writes it any more, seal it: start the daemon, or use grabberd storage seal"
RESERVE_BYTES = 256 * 1024
"""Size of the table `reserve`, which is filled at the start and emptied at the end: its pages take the ledger
and the verdict even if the disk is completely full."""
FREE_RESERVE = "DELETE FROM reserve WHERE typeof(data) = 'blob'"
"""Frees it; its text is a copy of the first metadata. SQLite moves those of the table `meta` to the end of
the file again and again, and without them nothing of a file that is cut off could be saved."""
JOURNAL_BYTES = 256 * 1024
"""Initial size of the journal, so that the sealing transaction need not extend it."""


def create(
    path: Path, max_pages: int | None = None, reserve_bytes: int = RESERVE_BYTES, version: int = VERSION
) -> sqlite3.Connection:
    """Creates a capture file of version 2 or 3; `max_pages` limits its size, for tests of a full disk.

    Raises:
        StorageError: The file exists, or cannot be written.
    """
    with storage_errors(path):
        for taken in (path, sealed_path(path)):
            if taken.exists():
                raise StorageError(f"{taken} exists already", "give the capture another name")
        with disk.create(path), removed_if_it_fails(path):
            return _created(path, max_pages, reserve_bytes, version)


def _created(path: Path, max_pages: int | None, reserve_bytes: int, version: int) -> sqlite3.Connection:
    # isolation_level None: the writer controls its transactions. The connection is created on one thread
    # and used on another, never on two at once.
    connection = disk.connect(path, disk.HeldConnection)
    try:
        # Not WAL: a copy without its log would be empty, and sealing would fail while there is a reader.
        # PERSIST keeps the journal between commits, since a full disk has no room for a new one.
        connection.execute("PRAGMA journal_mode = PERSIST")
        connection.execute("PRAGMA synchronous = FULL")  # a power cut costs no commit that returned
        connection.execute("PRAGMA busy_timeout = 10000")
        # Overwriting the freed reserve with zeros would journal all of its pages first.
        connection.execute("PRAGMA secure_delete = OFF")
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {version:d}")
        if max_pages is not None:
            connection.execute(f"PRAGMA max_page_count = {max_pages:d}")
        # One transaction: a kill leaves a file with all of its tables, or an empty one.
        connection.executescript("BEGIN;" + _TABLES[version])
        connection.execute("INSERT INTO reserve VALUES (zeroblob(?))", (reserve_bytes,))
        connection.execute("COMMIT")
        _reserve_journal(path.with_name(path.name + JOURNAL))
    except BaseException:
        connection.close()
        raise
    return connection


@contextmanager
def removed_if_it_fails(path: Path) -> Iterator[None]:
    """Removes a new file, which nobody would ever seal, if the block fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            remove_with_journal(path)
        raise


def remove_with_journal(path: Path) -> None:
    """Removes a database that is not in use yet, with its journal."""
    for one in (path, path.with_name(path.name + JOURNAL)):
        one.unlink(missing_ok=True)


def _reserve_journal(journal: Path) -> None:
    """Extends the journal; SQLite ignores anything beyond the end stated in its header."""
    with journal.open("r+b") as file:
        os.posix_fallocate(file.fileno(), 0, JOURNAL_BYTES)


def part_path(folder: Path, capture_id: str) -> Path:
    """Path of a new capture's file while it is written: `ID.grab.part`."""
    return folder / f"{capture_id}{SUFFIX}{PART}"


def sealed_path(part: Path) -> Path:
    """`NAME.grab` for `NAME.grab.part`; any other name is unchanged."""
    return part.with_name(part.name.removesuffix(PART))


def named_now(path: Path) -> Path:
    """Present path of a capture, which may have been sealed since its path was looked up."""
    sealed = sealed_path(path)
    return sealed if not path.exists() and sealed.is_file() else path


def connect(path: Path, *, writable: bool = False, is_cut: bool = False) -> GuardedConnection:
    """Opens an existing capture file and checks that it is exactly that, or what is left of one that is cut.

    Raises:
        CaptureFileError: The file is missing, not a capture, damaged, or of a later version.
        StorageError: The disk or another program prevents reading it.
    """
    with reading_errors(path):
        # A reader must not roll back what a writer is about to commit: it knows of the writer only by locks,
        # which some network file systems do not support. Code that seals a capture knows that there is none.
        may_roll_back = (writable or not path.name.endswith(PART)) and not is_cut
        connection = _opened(path, _version(path), writable=may_roll_back, is_cut=is_cut)
        try:
            connection.execute("PRAGMA synchronous = EXTRA")  # a power cut must not bring back its journal
            if not writable:
                connection.execute("PRAGMA query_only = ON")
        except BaseException:
            connection.close()
            raise
    return connection


def _opened(path: Path, version: int, *, writable: bool, is_cut: bool) -> GuardedConnection:
    try:
        return open_tables(path, _TABLES[version], writable=writable, is_cut=is_cut)
    except ValueError:
        # It may have been converted since its version was read.
        if (now := _version(path)) == version:
            raise
        return open_tables(path, _TABLES[now], writable=writable, is_cut=is_cut)


def _version(path: Path) -> int:
    header = read_header(path)
    if header.application_id != APPLICATION_ID:
        raise CaptureFileError(f"{path} is a database, but no capture", "choose a file that grabberd wrote")
    if header.user_version > max(_TABLES):
        raise LaterVersion(
            f"{path} has version {header.user_version}, this program reads up to {max(_TABLES)}",
            "use a newer grabberd",
        )
    if header.user_version not in _TABLES:
        raise ValueError(f"its version is {header.user_version}")
    return header.user_version


def format_of(connection: sqlite3.Connection) -> int:
    """Version of the layout of an open capture."""
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def _damaged(path: Path, error: Exception) -> CaptureFileError:
    if path.is_dir():
        return CaptureFileError(f"{path} is a folder, not a capture file", "name a capture file, NAME.grab")
    return CaptureFileError(
        f"{path} cannot be read as a capture: {error}",
        "if it was copied, copy it again; the sqlite3 program's .recover may save what is left",
    )


@contextmanager
def reading_errors(path: Path) -> Iterator[None]:
    """Translates errors: damaged content to `CaptureFileError`, a broken disk or a lock to `StorageError`.

    A cancelled reading raises `ReadingGivenUp`.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise _missing(path) from error
    except OSError as error:
        hint = NO_PERMISSION if isinstance(error, PermissionError) else _READABLE
        raise StorageError(f"{path} cannot be read now: {error}", hint) from error
    except sqlite3.DatabaseError as error:
        if not path.is_file():
            raise _missing(path) from error
        if _primary_code(error) == sqlite3.SQLITE_INTERRUPT:
            check_patience(path.name)
            hint = "ask for less at once; if it happens again and again, the file may be damaged"
            raise StorageError(f"{path} takes too long to read", hint) from error
        if _primary_code(error) in _NOT_THE_FILES_FAULT or disk.is_unreadable(error, path):
            raise _not_now(path, error) from error
        raise _damaged(path, error) from error
    except DAMAGE as error:
        raise _damaged(path, error) from error


def _not_now(path: Path, error: sqlite3.Error) -> StorageError:
    if error.sqlite_errorcode == sqlite3.SQLITE_READONLY_ROLLBACK:
        return StorageError(f"{path} cannot be read now: its last commit is unfinished", _UNFINISHED)
    return StorageError(f"{path} cannot be read now: {error}", _READABLE)


def _missing(path: Path) -> CaptureFileError:
    return CaptureFileError(f"no capture file {path}", "check the name; a running capture ends in .grab.part")


def _primary_code(error: sqlite3.Error) -> int:
    """The low byte of SQLite's code; 0 for errors raised by the Python module itself."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF
