"""Settings and the operator's choices, which no capture file holds."""

import json
from collections.abc import Mapping
from typing import Any

from grabberd.archive.state.state_database import StateDatabase


class StateStore(StateDatabase):
    """The settings in `state.sqlite`: a JSON value for each key."""

    def get(self, key: str) -> Any:
        """The value of a key; None if there is none."""
        with self.errors():
            rows = self.execute("SELECT value FROM settings WHERE key = ?", key)
            return json.loads(rows[0][0]) if rows else None

    def put(self, values: Mapping[str, Any]) -> None:
        """Writes some keys, all or none of them."""
        rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
        with self.transaction() as connection:
            connection.executemany("INSERT OR REPLACE INTO settings VALUES (?, ?)", rows)

    def remove(self, key: str) -> None:
        """Removes a key, if it exists."""
        self.execute("DELETE FROM settings WHERE key = ?", key)
