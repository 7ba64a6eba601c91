"""Requests with a key, and what they were answered, for a day."""

from datetime import timedelta
from pathlib import Path

from grabberd.service.clock import Clock, iso_utc
from grabberd.storage.state.idempotency_store import IdempotencyStore, KeptAnswer

KEPT = timedelta(days=1)


class Idempotency:
    """The keys of a state directory; they outlive the program."""

    def __init__(self, directory: Path, clock: Clock) -> None:
        self._store = IdempotencyStore(directory / "state.sqlite")
        self._clock = clock

    def begin(self, key: str, digest: bytes) -> KeptAnswer | None:
        """Keeps a new key and returns None; what is kept of a known one otherwise.

        Raises:
            StorageError: the state cannot be written.
        """
        now = self._clock.utc_now()
        return self._store.begin(key, digest, iso_utc(now), iso_utc(now - KEPT))

    def finish(self, key: str, answer: KeptAnswer) -> None:
        """Keeps the answer.

        Raises:
            StorageError: the state cannot be written.
        """
        self._store.finish(key, answer)

    def forget(self, key: str) -> None:
        """The request was refused: it may come again.

        Raises:
            StorageError: the state cannot be written.
        """
        self._store.forget(key)
