"""What the files do not know: settings and the operator's choices; cannot be made again, so back it up."""

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from grabberd.errors import StorageError

VERSION = 1
OWNER_ONLY = 0o600

_TABLE = "CREATE TABLE IF NOT EXISTS settings (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID"


class StateStore:
    """`state.sqlite`: a JSON value for each key; a connection for each call, so any thread may call."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def open(self) -> None:
        """Makes the file if it is not there, readable for its owner alone; safe twice.

        Raises:
            StorageError: it cannot be written, is damaged, or is of a later version.
        """
        with self._errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.touch(OWNER_ONLY)
        with self._changing() as connection:
            _check_version(connection, self.path)
            connection.execute(_TABLE)
            connection.execute(f"PRAGMA user_version = {VERSION:d}")

    def get(self, key: str) -> Any:
        """The value of a key; None where there is none.

        Raises:
            StorageError: the file cannot be read.
        """
        with self._changing() as connection:
            row = connection.execute("SELECT value FROM settings WHERE key = ?", (key,)).fetchone()
            return None if row is None else json.loads(row[0])

    def put(self, values: Mapping[str, Any]) -> None:
        """Writes some keys, all or none of them.

        Raises:
            StorageError: the file cannot be written.
        """
        rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
        with self._changing() as connection:
            connection.executemany("INSERT OR REPLACE INTO settings VALUES (?, ?)", rows)

    def remove(self, key: str) -> None:
        """Forgets a key; one that is not there stays so.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._changing() as connection:
            connection.execute("DELETE FROM settings WHERE key = ?", (key,))

    @contextmanager
    def _changing(self) -> Iterator[sqlite3.Connection]:
        """A connection and one transaction on it."""
        with self._errors(), closing(sqlite3.connect(self.path, timeout=10.0)) as connection, connection:
            yield connection

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError, ValueError) as error:
            raise StorageError(
                f"{self.path.name} cannot be used: {error}",
                "make room, mend the disk, or put back its latest backup",
            ) from error


def _check_version(connection: sqlite3.Connection, path: Path) -> None:
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version > VERSION:
        raise StorageError(
            f"{path.name} is of version {version}, this program knows up to {VERSION}", "use a newer grabberd"
        )
