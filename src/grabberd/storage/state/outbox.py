"""Summaries of captures that await acknowledgement by a receiver, and the captures that it knows."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from grabberd.storage.state.state_database import StateDatabase


class Outbox:
    """The captures entered in `state.sqlite`, each with its summary until that is acknowledged.

    An acknowledged capture stays entered without its summary, so that it is not sent again.
    """

    def __init__(self, path: Path) -> None:
        self._database = StateDatabase(path)

    def open(self) -> None:
        """Creates the file if necessary.

        Raises:
            StorageError: It cannot be written, is damaged, or is of a later version.
        """
        self._database.open()

    def entered(self) -> set[str]:
        """Ids of all captures that were entered and not forgotten.

        Raises:
            StorageError: The file cannot be read.
        """
        with self._database.transaction() as connection:
            return {row[0] for row in connection.execute("SELECT capture FROM outbox")}

    def enter(self, capture_id: str, summary: Mapping[str, Any]) -> None:
        """Stores a summary until it is acknowledged; an earlier one of the capture is left as it is.

        Raises:
            StorageError: The file cannot be written.
        """
        row = (capture_id, json.dumps(summary, ensure_ascii=False))
        with self._database.transaction() as connection:
            connection.execute("INSERT OR IGNORE INTO outbox VALUES (?, ?)", row)

    def waiting(self) -> int:
        """Number of summaries that are not acknowledged.

        Raises:
            StorageError: The file cannot be read.
        """
        with self._database.transaction() as connection:
            query = "SELECT count(*) FROM outbox WHERE summary IS NOT NULL"
            return int(connection.execute(query).fetchone()[0])

    def first(self) -> tuple[str, dict[str, Any]] | None:
        """The first waiting capture by id, and its summary; None if none is waiting.

        Raises:
            StorageError: The file cannot be read.
        """
        query = "SELECT capture, summary FROM outbox WHERE summary IS NOT NULL ORDER BY capture LIMIT 1"
        with self._database.transaction() as connection:
            row = connection.execute(query).fetchone()
        return None if row is None else (row[0], json.loads(row[1]))

    def acknowledge(self, capture_id: str) -> None:
        """Drops a summary that has arrived.

        Raises:
            StorageError: The file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("UPDATE outbox SET summary = NULL WHERE capture = ?", (capture_id,))

    def forget(self, captures: Collection[str]) -> None:
        """Forgets captures that no longer exist, except those whose summary is waiting.

        Raises:
            StorageError: The file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.executemany(
                "DELETE FROM outbox WHERE capture = ? AND summary IS NULL", [(one,) for one in captures]
            )
