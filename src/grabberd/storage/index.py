"""An index over many captures; it can always be made again from the files."""

import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import CaptureFileError, NotFound
from grabberd.storage.reader import CaptureReader
from grabberd.storage.schema import DAMAGED, storage_errors

SUFFIX = ".grab"

_TABLE = """
CREATE TABLE IF NOT EXISTS captures (
    id TEXT PRIMARY KEY, file TEXT NOT NULL, device TEXT NOT NULL, created_utc TEXT NOT NULL,
    state TEXT NOT NULL) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS newest ON captures (created_utc DESC);
"""


class IndexEntry(NamedTuple):
    """One capture; `file` is its name in the folder, `state` is sealed or damaged."""

    id: str
    file: str
    device: str
    created_utc: str
    state: str


class CaptureIndex:
    """`index.sqlite` beside the captures; a connection for each call, so any thread may call."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.path = directory / "index.sqlite"

    def rebuild(self) -> None:
        """Reads every capture file in the folder anew; what cannot be read is listed as damaged."""
        entries = [entry_of(path) for path in sorted(self.directory.glob(f"*{SUFFIX}"))]
        damaged = [_damaged(path) for path in sorted(self.directory.glob(f"*{SUFFIX}{DAMAGED}"))]
        with storage_errors(self.path):
            self.path.unlink(missing_ok=True)
            self._write([*entries, *damaged])

    def add(self, path: Path) -> None:
        """Enters a sealed capture, or what has become of it."""
        with storage_errors(self.path):
            self._write([entry_of(path)])

    def list(self) -> list[IndexEntry]:
        """All captures, the newest first."""
        with closing(self._connect()) as connection:
            rows = connection.execute("SELECT * FROM captures ORDER BY created_utc DESC, id DESC").fetchall()
        return [IndexEntry(*row) for row in rows]

    def get(self, capture_id: str) -> IndexEntry:
        """One capture.

        Raises:
            NotFound: there is none of that id.
        """
        with closing(self._connect()) as connection:
            row = connection.execute("SELECT * FROM captures WHERE id = ?", (capture_id,)).fetchone()
        if row is None:
            raise NotFound(f"no capture {capture_id!r}", "GET /api/v1/captures lists the captures there are")
        return IndexEntry(*row)

    def file_of(self, capture_id: str) -> Path:
        """Path of a capture's file.

        Raises:
            NotFound: there is none of that id.
        """
        return self.directory / self.get(capture_id).file

    def _write(self, entries: Iterable[IndexEntry]) -> None:
        with closing(self._connect()) as connection, connection:
            connection.executemany("INSERT OR REPLACE INTO captures VALUES (?, ?, ?, ?, ?)", entries)

    def _connect(self) -> sqlite3.Connection:
        self.directory.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(self.path, timeout=10.0)
        connection.executescript(_TABLE)
        return connection


def entry_of(path: Path) -> IndexEntry:
    """A capture file's entry; one that cannot be read is entered as damaged, under its name."""
    try:
        with CaptureReader(path) as reader:
            meta = reader.meta
            return IndexEntry(meta.id, path.name, str(meta.device["name"]), meta.created_utc, "sealed")
    except CaptureFileError:
        return _damaged(path)


def _damaged(path: Path) -> IndexEntry:
    return IndexEntry(path.name.split(".")[0], path.name, "", "", "damaged")
