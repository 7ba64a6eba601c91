"""Answers to requests that must take effect once, however often they are sent."""

from pathlib import Path
from typing import NamedTuple

from grabberd.storage.state.state_database import StateDatabase


class KeptAnswer(NamedTuple):
    """What a request with a key was answered; `status` is None as long as it was not.

    Attributes:
        digest: of the request.
        status: of HTTP; `location` and `body` belong to it.
    """

    digest: bytes
    status: int | None = None
    location: str | None = None
    body: bytes = b""


class IdempotencyStore:
    """The keys in `state.sqlite`. Times are ISO 8601 UTC, all in one format: they compare."""

    def __init__(self, path: Path) -> None:
        self._database = StateDatabase(path)

    def begin(self, key: str, digest: bytes, now_utc: str, oldest_utc: str) -> KeptAnswer | None:
        """Keeps a key, and forgets those from before `oldest_utc`; what is kept of it already, or None.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM idempotency WHERE created_utc < ?", (oldest_utc,))
            row = connection.execute(
                "SELECT digest, status, location, body FROM idempotency WHERE key = ?", (key,)
            ).fetchone()
            if row is not None:
                return KeptAnswer(*row)
            connection.execute(
                "INSERT INTO idempotency (key, digest, created_utc) VALUES (?, ?, ?)", (key, digest, now_utc)
            )
            return None

    def finish(self, key: str, answer: KeptAnswer) -> None:
        """Keeps the answer.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute(
                "UPDATE idempotency SET status = ?, location = ?, body = ? WHERE key = ?",
                (answer.status, answer.location, answer.body, key),
            )

    def forget(self, key: str) -> None:
        """The request had no effect: it may come again.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM idempotency WHERE key = ?", (key,))
