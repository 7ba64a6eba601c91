"""Summaries of captures that a receiver has not acknowledged yet, and which captures it knows."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from grabberd.storage.state.state_database import StateDatabase


class Outbox:
    """The captures in `state.sqlite` that were entered: each with its summary, until that is acknowledged.

    What was acknowledged stays entered, without its summary: so that it is not sent again.
    """

    def __init__(self, path: Path) -> None:
        self._database = StateDatabase(path)

    def open(self) -> None:
        """Makes the file if it is not there; safe twice.

        Raises:
            StorageError: it cannot be written, is damaged, or is of a later version.
        """
        self._database.open()

    def entered(self) -> set[str]:
        """The ids of all captures that were entered and not forgotten.

        Raises:
            StorageError: the file cannot be read.
        """
        with self._database.transaction() as connection:
            return {row[0] for row in connection.execute("SELECT capture FROM outbox")}

    def enter(self, capture_id: str, summary: Mapping[str, Any]) -> None:
        """Keeps a summary until it is acknowledged; one that is entered stays as it is.

        Raises:
            StorageError: the file cannot be written.
        """
        row = (capture_id, json.dumps(summary, ensure_ascii=False))
        with self._database.transaction() as connection:
            connection.execute("INSERT OR IGNORE INTO outbox VALUES (?, ?)", row)

    def waiting(self) -> int:
        """How many summaries are not acknowledged.

        Raises:
            StorageError: the file cannot be read.
        """
        with self._database.transaction() as connection:
            query = "SELECT count(*) FROM outbox WHERE summary IS NOT NULL"
            return int(connection.execute(query).fetchone()[0])

    def first(self) -> tuple[str, dict[str, Any]] | None:
        """The first capture that waits, by its id, and its summary; None where none does.

        Raises:
            StorageError: the file cannot be read.
        """
        query = "SELECT capture, summary FROM outbox WHERE summary IS NOT NULL ORDER BY capture LIMIT 1"
        with self._database.transaction() as connection:
            row = connection.execute(query).fetchone()
        return None if row is None else (row[0], json.loads(row[1]))

    def acknowledge(self, capture_id: str) -> None:
        """Its summary has arrived, and is not kept any longer.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("UPDATE outbox SET summary = NULL WHERE capture = ?", (capture_id,))

    def forget(self, captures: Collection[str]) -> None:
        """Captures that are gone need not be known any longer; those that wait stay.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.executemany(
                "DELETE FROM outbox WHERE capture = ? AND summary IS NULL", [(one,) for one in captures]
            )
