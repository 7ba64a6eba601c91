"""Settings and the operator's choices, which no capture file holds."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grabberd.storage.state.state_database import StateDatabase


class StateStore:
    """The settings in `state.sqlite`: a JSON value for each key."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._database = StateDatabase(path)

    def open(self) -> None:
        """Creates the file if necessary.

        Raises:
            StorageError: It cannot be written, is damaged, or is of a later version.
        """
        self._database.open()

    def get(self, key: str) -> Any:
        """The value of a key; None if there is none.

        Raises:
            StorageError: The file cannot be read.
        """
        with self._database.transaction() as connection:
            row = connection.execute("SELECT value FROM settings WHERE key = ?", (key,)).fetchone()
            return None if row is None else json.loads(row[0])

    def put(self, values: Mapping[str, Any]) -> None:
        """Writes some keys, all or none of them.

        Raises:
            StorageError: The file cannot be written.
        """
        rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
        with self._database.transaction() as connection:
            connection.executemany("INSERT OR REPLACE INTO settings VALUES (?, ?)", rows)

    def remove(self, key: str) -> None:
        """Removes a key, if it exists.

        Raises:
            StorageError: The file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM settings WHERE key = ?", (key,))
