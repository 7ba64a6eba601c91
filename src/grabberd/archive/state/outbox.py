"""Summaries of captures that await acknowledgement by a receiver, and the captures that it knows."""

import json
from collections.abc import Collection, Mapping
from typing import Any

from grabberd.archive.state.state_database import StateDatabase


class Outbox(StateDatabase):
    """The captures entered in `state.sqlite`, each with its summary until that is acknowledged.

    An acknowledged capture stays entered without its summary, so that it is not sent again.
    """

    def entered(self) -> set[str]:
        """Ids of all captures that were entered and not forgotten."""
        return {capture_id for (capture_id,) in self.execute("SELECT capture FROM outbox")}

    def enter(self, capture_id: str, summary: Mapping[str, Any]) -> None:
        """Stores a summary until it is acknowledged; an earlier one of the capture is left as it is."""
        document = json.dumps(summary, ensure_ascii=False)
        self.execute("INSERT OR IGNORE INTO outbox VALUES (?, ?)", capture_id, document)

    def waiting(self) -> int:
        """Number of summaries that are not acknowledged."""
        return int(self.execute("SELECT count(*) FROM outbox WHERE summary IS NOT NULL")[0][0])

    def first(self) -> tuple[str, dict[str, Any]] | None:
        """The first waiting capture by id, and its summary; None if none is waiting."""
        query = "SELECT capture, summary FROM outbox WHERE summary IS NOT NULL ORDER BY capture LIMIT 1"
        return next(
            ((capture_id, json.loads(document)) for capture_id, document in self.execute(query)), None
        )

    def acknowledge(self, capture_id: str) -> None:
        """Drops a summary that has arrived."""
        self.execute("UPDATE outbox SET summary = NULL WHERE capture = ?", capture_id)

    def forget(self, captures: Collection[str]) -> None:
        """Forgets captures that no longer exist, except those whose summary is waiting."""
        with self.transaction() as connection:
            connection.executemany(
                "DELETE FROM outbox WHERE capture = ? AND summary IS NULL", [(one,) for one in captures]
            )
