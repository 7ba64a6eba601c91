"""An index of captures, which can be rebuilt from their files at any time."""

import builtins
import json
import os
import sqlite3
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from pathlib import Path
from typing import NamedTuple, TypeVar

from grabberd.errors import CaptureFileError, LaterVersion, NotFound, StorageError
from grabberd.storage.capture.crash_recovery import numbered, set_aside
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.capture.schema import DAMAGED, JOURNAL, PART, SUFFIX
from grabberd.storage.disk import is_damaged, storage_errors

T = TypeVar("T")
CAPTURES = (SUFFIX, PART)
_LAST = "~"
"""Sorts after every time."""
_INSERT = "INSERT OR REPLACE INTO captures VALUES (?, ?, ?, ?, ?, ?, ?)"
_NOTHING = nullcontext()

VERSION = 1
_TABLE = f"""
CREATE TABLE captures (
    id TEXT PRIMARY KEY, file TEXT NOT NULL, device TEXT NOT NULL, created_utc TEXT NOT NULL,
    state TEXT NOT NULL, note TEXT NOT NULL DEFAULT '', labels TEXT NOT NULL DEFAULT '{{}}') WITHOUT ROWID;
CREATE INDEX newest ON captures (created_utc DESC);
PRAGMA user_version = {VERSION};
"""


class Unusable(Exception):
    """The index is missing or damaged: it has to be rebuilt."""


class IndexEntry(NamedTuple):
    """One capture.

    Attributes:
        file: Path below the folder.
        state: "sealed" or "damaged".
        note: Note in the file, for searching.
        labels: Labels in the file as a JSON object, for searching.
    """

    id: str
    file: str
    device: str
    created_utc: str
    state: str
    note: str = ""
    labels: str = "{}"


class CaptureIndex:
    """`index.sqlite` beside the captures; each call has its own connection, so any thread may call.

    Captures that could not be entered because the disk was full are entered as soon as there is room.

    Args:
        directory: Folder of the captures.
        check: Raises StorageError while the folder is not there.
        heal: Rebuilds an index that is missing or damaged, or raises StorageError; by default at once.

    Attributes:
        read: While it is rebuilt, how many captures have been read, and of how many.
    """

    def __init__(
        self,
        directory: Path,
        check: Callable[[], None] = lambda: None,
        heal: Callable[[Unusable], None] | None = None,
    ) -> None:
        self.directory = directory
        self.path = directory / "index.sqlite"
        self.read = (0, 0)
        self._check = check
        self._heal = heal or (lambda _: self.rebuild())
        self._kept_out: set[Path] = set()
        self._changing = threading.Lock()
        self._rebuilding = False

    def rebuild(self, unsealed: Iterable[Path] = ()) -> None:
        """Rebuilds the index from the capture files; those that cannot be read are set aside as damaged.

        Captures that end meanwhile are entered afterwards.

        Args:
            unsealed: `.grab.part` files that nobody writes and that could not be sealed.

        Raises:
            StorageError: The index cannot be written.
        """
        self._rebuilding = True
        try:
            entries = list(_distinct(self._entries(unsealed)))
            with self._changing:
                self._publish([one for one in entries if (self.directory / one.file).exists()])
        finally:
            self._rebuilding = False

    def add(self, path: Path) -> None:
        """Enters a sealed capture, as damaged if it cannot be read.

        Raises:
            StorageError: The index cannot be written now; the capture is entered later.
        """
        self._kept_out.add(path)
        self._enter_kept_out()

    def remove(self, capture_id: str) -> None:
        """Removes a capture, if it is in the index."""
        self._change(
            lambda connection: connection.execute("DELETE FROM captures WHERE id = ?", (capture_id,))
        )

    def list(self) -> list[IndexEntry]:
        """All captures, newest first."""
        return self._select("ORDER BY created_utc DESC, id DESC")

    def page(self, after: tuple[str, str] | None, limit: int) -> "builtins.list[IndexEntry]":
        """At most `limit` captures, newest first, that follow the (created_utc, id) of `after`, if given."""
        beyond = after or (_LAST, "")
        which = "WHERE (created_utc, id) < (?, ?) ORDER BY created_utc DESC, id DESC LIMIT ?"
        return self._select(which, *beyond, limit)

    def get(self, capture_id: str) -> IndexEntry:
        """One capture.

        Raises:
            NotFound: No capture has that id.
        """
        found = self._select("WHERE id = ?", capture_id)
        if not found:
            raise NotFound(f"no capture {capture_id!r}", "GET /api/v1/captures lists all captures")
        return found[0]

    def with_prefix(self, text: str) -> "builtins.list[IndexEntry]":
        """Captures whose id begins with `text`, sorted by id."""
        # Not LIKE, in which the _ and % of an id stand for any letters.
        return self._select("WHERE substr(id, 1, ?) = ? ORDER BY id", len(text), text)

    def file_of(self, capture_id: str) -> Path:
        """Path of a capture's file.

        Raises:
            NotFound: No capture has that id.
        """
        return self.directory / self.get(capture_id).file

    def _entries(self, unsealed: Iterable[Path]) -> Iterator[IndexEntry]:
        sealed = sorted(self.directory.glob(f"*{SUFFIX}"))
        for number, path in enumerate(sealed):
            self.read = (number, len(sealed))
            if (entry := _readable(path)) is not None:
                yield entry
        yield from map(entry_of, unsealed)
        # Last: files that could not be read have only now been set aside.
        aside = sorted((self.directory / DAMAGED).glob("*"))
        yield from (_damaged(path) for path in aside if path.suffix in CAPTURES)

    def _publish(self, entries: Iterable[IndexEntry]) -> None:
        """Replaces the index by a new one, complete or not at all."""
        new = self.path.with_name(f".{self.path.name}{PART}")
        with storage_errors(self.path):
            _forget(new)
            with closing(sqlite3.connect(new)) as connection:
                connection.executescript(_TABLE)
                with connection:
                    connection.executemany(_INSERT, entries)
            # A journal that was left beside the old one would be played back into the new.
            self.path.with_name(self.path.name + JOURNAL).unlink(missing_ok=True)
            os.replace(new, self.path)

    def _select(self, which: str, *values: object) -> "builtins.list[IndexEntry]":
        """Captures by the rest of a query, after those that could not be entered before."""
        if self._kept_out:
            with suppress(StorageError):
                self._enter_kept_out()
        query = f"SELECT * FROM captures {which}"  # noqa: S608 - constants
        return self._use(lambda connection: [IndexEntry(*row) for row in connection.execute(query, values)])

    def _enter_kept_out(self) -> None:
        # One that has begun may have missed their files, and will replace what is written into the index now.
        if self._rebuilding:
            return
        paths = sorted(self._kept_out)
        self._write([entry_of(path) for path in paths if path.exists()])
        self._kept_out.difference_update(paths)

    def _write(self, entries: "builtins.list[IndexEntry]") -> None:
        self._change(lambda connection: connection.executemany(_INSERT, entries))

    def _change(self, act: Callable[[sqlite3.Connection], object]) -> None:
        """Changes the index, but not while a new one takes its place."""
        self._use(act, self._changing)

    def _use(
        self, act: Callable[[sqlite3.Connection], T], held: AbstractContextManager[object] = _NOTHING
    ) -> T:
        """Acts in one transaction, once more if the index had to be rebuilt first."""
        self._check()
        try:
            with held:
                return self._attempt(act)
        except Unusable as reason:
            self._heal(reason)
        try:
            with held:
                return self._attempt(act)
        except Unusable as reason:
            raise self._error(reason) from reason

    def _attempt(self, act: Callable[[sqlite3.Connection], T]) -> T:
        uri = f"{self.path.absolute().as_uri()}?mode=rw"
        try:
            with closing(sqlite3.connect(uri, uri=True, timeout=10.0)) as connection, connection:
                if connection.execute("PRAGMA user_version").fetchone()[0] != VERSION:
                    raise Unusable("it is empty, or of another version")
                return act(connection)
        except (sqlite3.Error, OSError) as error:
            if isinstance(error, sqlite3.DatabaseError) and (is_damaged(error) or not self.path.exists()):
                raise Unusable(f"{error}" if self.path.exists() else "it is gone") from error
            raise self._error(error) from error

    def _error(self, error: Exception) -> StorageError:
        return StorageError(
            f"{self.path.name} cannot be used: {error}",
            "make room or fix the disk; captures go on, and the index is rebuilt by itself",
        )


def _forget(database: Path) -> None:
    for path in (database, database.with_name(database.name + JOURNAL)):
        path.unlink(missing_ok=True)


def entry_of(path: Path) -> IndexEntry:
    """A capture file's entry; one that cannot be read is damaged, with its file's name as id."""
    try:
        return _read(path)
    except (CaptureFileError, StorageError):
        return _damaged(path)


def _read(path: Path) -> IndexEntry:
    with CaptureReader(path) as reader:
        meta = reader.meta
        labels = json.dumps(meta.labels, ensure_ascii=False)
        device = str(meta.device["name"])
        return IndexEntry(meta.id, path.name, device, meta.created_utc, "sealed", meta.note, labels)


def _readable(path: Path) -> IndexEntry | None:
    """A file's entry; None if it was damaged and has been set aside."""
    try:
        return _read(path)
    except (LaterVersion, StorageError):  # the file itself may be sound: it stays where it is
        return _damaged(path)
    except CaptureFileError as error:
        with suppress(StorageError):
            set_aside(path, error.message)
            return None
        return _damaged(path)


def _damaged(path: Path) -> IndexEntry:
    folder = f"{DAMAGED}/" if path.parent.name == DAMAGED else ""
    return IndexEntry(path.name.split(".")[0], folder + path.name, "", "", "damaged")


def _distinct(entries: Iterable[IndexEntry]) -> Iterator[IndexEntry]:
    """Entries with distinct ids: a second file of the same id, such as a copy, gets `ID-2` and so on."""
    taken: set[str] = set()
    for entry in entries:
        free = next(name for name in numbered(entry.id) if name not in taken)
        taken.add(free)
        yield entry._replace(id=free)
