"""An index of captures, which can be rebuilt from their files at any time."""

import builtins
import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import CaptureFileError, LaterVersion, NotFound, StorageError
from grabberd.storage.capture.crash_recovery import numbered, set_aside
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.capture.schema import DAMAGED, PART, SUFFIX
from grabberd.storage.disk import storage_errors

CAPTURES = (SUFFIX, PART)
_LAST = "~"
"""Sorts after every time."""

_TABLE = """
CREATE TABLE IF NOT EXISTS captures (
    id TEXT PRIMARY KEY, file TEXT NOT NULL, device TEXT NOT NULL, created_utc TEXT NOT NULL,
    state TEXT NOT NULL, note TEXT NOT NULL DEFAULT '', labels TEXT NOT NULL DEFAULT '{}') WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS newest ON captures (created_utc DESC);
"""


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
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.path = directory / "index.sqlite"
        self._kept_out: set[Path] = set()

    def rebuild(self, unsealed: Iterable[Path] = ()) -> None:
        """Rebuilds the index from the capture files; those that cannot be read are set aside as damaged.

        Args:
            unsealed: `.grab.part` files that nobody writes and that could not be sealed.

        Raises:
            StorageError: The index cannot be written.
        """
        readable = [_readable(path) for path in sorted(self.directory.glob(f"*{SUFFIX}"))]
        aside = [path for path in sorted((self.directory / DAMAGED).glob("*")) if path.suffix in CAPTURES]
        # Deleted rather than emptied: it may be damaged itself.
        with storage_errors(self.path):
            self.path.unlink(missing_ok=True)
        self._write(_distinct([*filter(None, readable), *map(entry_of, unsealed), *map(_damaged, aside)]))

    def add(self, path: Path) -> None:
        """Enters a sealed capture, as damaged if it cannot be read.

        Raises:
            StorageError: The index cannot be written now; the capture is entered later.
        """
        self._kept_out.add(path)
        self._enter_kept_out()

    def remove(self, capture_id: str) -> None:
        """Removes a capture, if it is in the index."""
        with self._connected() as connection:
            connection.execute("DELETE FROM captures WHERE id = ?", (capture_id,))

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

    def _select(self, which: str, *values: object) -> "builtins.list[IndexEntry]":
        """Captures by the rest of a query, after those that could not be entered before."""
        if self._kept_out:
            with suppress(StorageError):
                self._enter_kept_out()
        query = f"SELECT * FROM captures {which}"  # noqa: S608 - constants
        with self._connected() as connection:
            return [IndexEntry(*row) for row in connection.execute(query, values)]

    def _enter_kept_out(self) -> None:
        paths = sorted(self._kept_out)
        self._write([entry_of(path) for path in paths if path.exists()])
        self._kept_out.difference_update(paths)

    def _write(self, entries: Iterable[IndexEntry]) -> None:
        with self._connected() as connection:
            connection.executemany("INSERT OR REPLACE INTO captures VALUES (?, ?, ?, ?, ?, ?, ?)", entries)

    @contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        """A connection and one transaction on it."""
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(self.path, timeout=10.0)) as connection, connection:
                connection.executescript(_TABLE)
                yield connection
        except (sqlite3.Error, OSError) as error:
            hint = "fix the disk, then start again: the index is rebuilt from the files"
            raise StorageError(f"{self.path.name} cannot be used: {error}", hint) from error


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
