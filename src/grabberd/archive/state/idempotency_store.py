"""Stored answers to requests that must take effect once, however often they are sent."""

from typing import NamedTuple

from grabberd.archive.state.state_database import StateDatabase


class KeptAnswer(NamedTuple):
    """The answer to a request with a key.

    Attributes:
        digest: Digest of the request.
        status: HTTP status; None while the request is unanswered.
        location: Header `Location` of the answer.
        body: Body of the answer.
    """

    digest: bytes
    status: int | None = None
    location: str | None = None
    body: bytes = b""


class IdempotencyStore(StateDatabase):
    """The keys in `state.sqlite`. Times are ISO 8601 UTC in one format: they sort as text."""

    def begin(self, key: str, digest: bytes, now_utc: str, oldest_utc: str) -> KeptAnswer | None:
        """Stores a key and drops those older than `oldest_utc`; returns what was stored for it before."""
        with self.transaction() as connection:
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
        """Stores the answer."""
        change = "UPDATE idempotency SET status = ?, location = ?, body = ? WHERE key = ?"
        self.execute(change, answer.status, answer.location, answer.body, key)

    def forget(self, key: str) -> None:
        """Removes a key whose request had no effect, so that it may be sent again."""
        self.execute("DELETE FROM idempotency WHERE key = ?", key)
