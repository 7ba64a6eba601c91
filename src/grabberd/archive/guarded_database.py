"""Opening untrusted database files: their content is treated as data, never as code.

A file in the captures folder may come from a USB stick, a network share or a broken disk. SQLite itself would
execute what such a file contains: a view instead of a table can be endless, a journal beside it can cause
another file to be deleted, and a link can lead to a confidential file.
"""

import os
import sqlite3
import stat
import struct
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import runtime
from grabberd.errors import count_of
from grabberd.files.disk import HeldConnection, connect, hold
from grabberd.files.reading import is_over

JOURNAL = "-journal"
LONGEST_S = 300.0
"""Time limit for a statement: enough to read all rows of a day's capture from a slow disk."""
LARGEST_CELL = 64 << 20
"""Largest value in bytes: four times the largest picture."""
LARGEST_SQL = 100_000
_OPCODES = 10_000
"""SQLite instructions between two checks of the time limit, about a millisecond."""
_WAIT_S = 10.0
"""Longest wait for another program's lock."""
_MAGIC = b"SQLite format 3\0"
_JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")
_HEAD = 108
"""Bytes of a database's header and of the header of its first page, which contains the schema."""
_LEAF = 0x0D
_UTF_8 = 1
_ROLLBACK_JOURNAL = (1, 1)


class Header(NamedTuple):
    """Decoded header of a database file.

    Attributes:
        application_id: Id of the program that wrote the file.
        user_version: Version of its tables.
    """

    application_id: int
    user_version: int


class GuardedConnection(HeldConnection):
    """A connection whose statements are interrupted by a time limit, or when the reading is cancelled.

    Attributes:
        longest_s: Time limit for one statement.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.longest_s = LONGEST_S
        self._until_s = runtime.monotonic() + LONGEST_S
        self.set_progress_handler(self._has_to_stop, _OPCODES)
        self.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CELL)
        self.setlimit(sqlite3.SQLITE_LIMIT_SQL_LENGTH, LARGEST_SQL)
        self.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
        self.setlimit(sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 1)
        # Functions in a file's schema would run with the rights of this process.
        self.execute("PRAGMA trusted_schema = OFF")
        self.execute("PRAGMA cell_size_check = ON")

    def execute(self, *args: Any) -> sqlite3.Cursor:
        """See `sqlite3.Connection.execute`."""
        self._until_s = runtime.monotonic() + self.longest_s
        return super().execute(*args)

    def executemany(self, *args: Any) -> sqlite3.Cursor:
        """See `sqlite3.Connection.executemany`."""
        self._until_s = runtime.monotonic() + self.longest_s
        return super().executemany(*args)

    def _has_to_stop(self) -> bool:
        return runtime.monotonic() > self._until_s or is_over()


def read_header(path: Path) -> Header:
    """Reads and checks the header of a file.

    Raises:
        FileNotFoundError: The file does not exist.
        ValueError: The file or its journal cannot have been written by this program.
        OSError: The file cannot be read.
    """
    check_kind(path)
    _check_journal(path.with_name(path.name + JOURNAL))
    return _header(_head(path))


def open_tables(path: Path, tables: str, *, writable: bool = True, is_cut: bool = False) -> GuardedConnection:
    """Opens an existing database with exactly these tables.

    Args:
        path: The file.
        tables: The statements that created its tables; whitespace is ignored.
        writable: False if not even an interrupted transaction may be rolled back.
        is_cut: True to read what is left of a file that lacks its end, though its header says otherwise.

    Returns:
        A connection in autocommit mode, which any thread may use in turn.

    Raises:
        FileNotFoundError: The file does not exist.
        ValueError: The file has a different schema.
        sqlite3.Error: The file is damaged, or cannot be read.
        OSError: The file cannot be read.
    """
    with hold(path):  # the file is opened only once
        read_header(path)
        _check_schema_page(_head(path), len(_schema(tables)))
        connection = connect(path, GuardedConnection, writable=writable, timeout=_WAIT_S)
    try:
        if is_cut:  # with this alone, SQLite goes by the length that the file has
            connection.execute("PRAGMA writable_schema = ON")
        found = schema_of(connection)
        if found != _schema(tables):
            other = sorted({str(name) for _, name, _ in found ^ _schema(tables)})
            raise ValueError(f"its schema differs: {', '.join(other)[:200]}")
    except BaseException:
        connection.close()
        raise
    return connection


def check_kind(path: Path) -> None:
    """Checks that a path is a regular file.

    Raises:
        FileNotFoundError: It does not exist.
        ValueError: It is a link, a folder or a device.
        OSError: It cannot be looked up.
    """
    # A link could lead to any file that this process may read, and clients could download that.
    if not stat.S_ISREG(path.lstat().st_mode):
        raise ValueError("it is a link, a folder or a device, not a regular file")


def _check_journal(journal: Path) -> None:
    """Checks that a journal is not part of a multi-file transaction."""
    try:
        check_kind(journal)
        with journal.open("rb") as file:
            file.seek(max(0, journal.stat().st_size - len(_JOURNAL_MAGIC)))
            end = file.read(len(_JOURNAL_MAGIC))
    except FileNotFoundError:
        return
    # Such a journal names a file shared by all journals of the transaction, which SQLite would delete.
    if end == _JOURNAL_MAGIC:
        raise ValueError(f"{journal.name} belongs to another database as well")


def _head(path: Path) -> bytes:
    with hold(path) as held:
        return os.pread(held.descriptor, _HEAD, 0)


def _header(head: bytes) -> Header:
    if not head.startswith(_MAGIC) or len(head) < _HEAD:
        raise ValueError("file is not a database" if head else "it is empty")
    if (head[18], head[19]) != _ROLLBACK_JOURNAL:
        raise ValueError("it keeps a write-ahead log")
    (encoding,) = struct.unpack_from(">I", head, 56)
    if encoding != _UTF_8:
        raise ValueError("its texts are not in UTF-8")
    (user_version,) = struct.unpack_from(">i", head, 60)
    (application_id,) = struct.unpack_from(">I", head, 68)
    return Header(application_id, user_version)


def _check_schema_page(head: bytes, entries: int) -> None:
    """Checks that the schema fits on the first page, before SQLite reads all of it into memory."""
    kind, (found,) = head[100], struct.unpack_from(">H", head, 103)
    if kind != _LEAF or found != entries:
        has = (
            f"more than {entries} entries"
            if kind != _LEAF
            else f"{count_of(found, 'entry', 'entries')}, not {entries}"
        )
        raise ValueError(f"its schema has {has}")


Entry = tuple[str, str, str]


@cache
def _schema(tables: str) -> frozenset[Entry]:
    with runtime.connect(":memory:") as connection:
        connection.executescript(tables)
        found = schema_of(connection)
    connection.close()
    return found


def schema_of(connection: sqlite3.Connection) -> frozenset[Entry]:
    """Kind, name and statement of each table and index, whatever blanks the statements have."""
    rows = connection.execute("SELECT type, name, sql FROM sqlite_schema").fetchall()
    return frozenset((kind, name, " ".join(str(sql).split())) for kind, name, sql in rows)
