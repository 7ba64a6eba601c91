"""The door through which database files from outside are opened: their content is data, never a program.

A file in the folder of captures may come from a USB stick, a network share or a broken disk. SQLite itself
would run what such a file holds: a view in place of a table can be endless, a journal beside it can name
another file to be deleted, a link can lead to a file that is nobody's business.
"""

import os
import sqlite3
import stat
import struct
import time
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.files.held_files import HeldConnection, connect, hold
from grabberd.files.patience import is_over

JOURNAL = "-journal"
LONGEST_S = 300.0
"""Time that one statement may take: it reads all rows of a day's capture from a slow disk, and ends."""
LARGEST_CELL = 64 << 20
"""Bytes of one value: four times the largest picture."""
LARGEST_SQL = 100_000
_OPCODES = 10_000
"""Instructions of SQLite between two looks at the clock, about a millisecond."""
_WAIT_S = 10.0
"""Time to wait for another program's lock."""
_MAGIC = b"SQLite format 3\0"
_JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")
_HEAD = 108
"""Bytes of a database's header and of the head of its first page, which holds the schema."""
_LEAF = 0x0D
_UTF_8 = 1
_ROLLBACK_JOURNAL = (1, 1)


class Header(NamedTuple):
    """First bytes of a database file, decoded.

    Attributes:
        application_id: Program that the file belongs to.
        user_version: Version of its tables.
    """

    application_id: int
    user_version: int


class GuardedConnection(HeldConnection):
    """A connection whose every statement ends: in time, or when nobody waits for it any longer.

    Attributes:
        longest_s: Time that one statement may take.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.longest_s = LONGEST_S
        self._until_s = time.monotonic() + LONGEST_S
        self.set_progress_handler(self._has_to_stop, _OPCODES)
        self.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CELL)
        self.setlimit(sqlite3.SQLITE_LIMIT_SQL_LENGTH, LARGEST_SQL)
        self.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
        self.setlimit(sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 1)
        # Functions of a file's own schema would run with the rights of the program.
        self.execute("PRAGMA trusted_schema = OFF")
        self.execute("PRAGMA cell_size_check = ON")

    def execute(self, *args: Any) -> sqlite3.Cursor:
        """See `sqlite3.Connection.execute`."""
        self._until_s = time.monotonic() + self.longest_s
        return super().execute(*args)

    def executemany(self, *args: Any) -> sqlite3.Cursor:
        """See `sqlite3.Connection.executemany`."""
        self._until_s = time.monotonic() + self.longest_s
        return super().executemany(*args)

    def _has_to_stop(self) -> bool:
        return time.monotonic() > self._until_s or is_over()


def read_header(path: Path) -> Header:
    """The header of a file that may be opened.

    Raises:
        FileNotFoundError: It does not exist.
        ValueError: It, or the journal beside it, is none that this program has written.
        OSError: It cannot be read.
    """
    check_kind(path)
    _check_journal(path.with_name(path.name + JOURNAL))
    return _header(_head(path))


def open_tables(path: Path, tables: str, *, writable: bool = True) -> GuardedConnection:
    """Opens an existing database of exactly these tables.

    Args:
        path: The file.
        tables: The statements that its tables were made by; spaces and line breaks are ignored.
        writable: False if not even what a crash left unfinished may be rolled back.

    Returns:
        A connection in autocommit mode, which any thread may use in turn.

    Raises:
        FileNotFoundError: It does not exist.
        ValueError: It holds anything else.
        sqlite3.Error: It is damaged, or cannot be read.
        OSError: It cannot be read.
    """
    with hold(path):  # opened once for all that follows
        read_header(path)
        _check_schema_page(_head(path), len(_schema(tables)))
        connection = connect(path, GuardedConnection, writable=writable, timeout=_WAIT_S)
    try:
        found = _schema_of(connection)
        if found != _schema(tables):
            other = sorted({name for _, name, _ in found ^ _schema(tables)})
            raise ValueError(f"its schema is another one: {', '.join(other)[:200]}")
    except BaseException:
        connection.close()
        raise
    return connection


def check_kind(path: Path) -> None:
    """Checks that a path leads to a file of its own.

    Raises:
        FileNotFoundError: It leads nowhere.
        ValueError: It is a link, a folder or a device.
        OSError: It cannot be looked up.
    """
    # A link could lead to any file that this program may read, which clients could then download.
    if not stat.S_ISREG(path.lstat().st_mode):
        raise ValueError("it is a link, a folder or a device, and not a file of its own")


def _check_journal(journal: Path) -> None:
    """Checks that a journal belongs to its database alone."""
    try:
        check_kind(journal)
        with journal.open("rb") as file:
            file.seek(max(0, journal.stat().st_size - len(_JOURNAL_MAGIC)))
            end = file.read(len(_JOURNAL_MAGIC))
    except FileNotFoundError:
        return
    # It names a file that all journals of one transaction share. SQLite deletes that file, whatever it is.
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
        raise ValueError(f"its schema has {'more than' if kind != _LEAF else found} {entries} entries")


Entry = tuple[str, str, str]


@cache
def _schema(tables: str) -> frozenset[Entry]:
    with sqlite3.connect(":memory:") as connection:
        connection.executescript(tables)
        found = _schema_of(connection)
    connection.close()
    return found


def _schema_of(connection: sqlite3.Connection) -> frozenset[Entry]:
    rows = connection.execute("SELECT type, name, sql FROM sqlite_schema").fetchall()
    return frozenset((kind, name, " ".join(str(sql).split())) for kind, name, sql in rows)
