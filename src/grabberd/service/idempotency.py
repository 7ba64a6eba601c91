"""Idempotency keys of requests, with the answers they got, kept for a day."""

from datetime import timedelta
from pathlib import Path

from grabberd.acquisition.clock import UtcClock, iso_utc
from grabberd.storage.state.idempotency_store import IdempotencyStore, KeptAnswer

KEPT = timedelta(days=1)


class Idempotency:
    """Idempotency keys of a state directory; they outlive the program."""

    def __init__(self, directory: Path, clock: UtcClock) -> None:
        self._store = IdempotencyStore(directory / "state.sqlite")
        self._clock = clock

    def begin(self, key: str, digest: bytes) -> KeptAnswer | None:
        """Stores a new key and returns None; returns the stored answer for a known one.

        Raises:
            StorageError: The state cannot be written.
        """
        now = self._clock.utc_now()
        return self._store.begin(key, digest, iso_utc(now), iso_utc(now - KEPT))

    def finish(self, key: str, answer: KeptAnswer) -> None:
        """Stores the answer.

        Raises:
            StorageError: The state cannot be written.
        """
        self._store.finish(key, answer)

    def forget(self, key: str) -> None:
        """Removes a key whose request was refused, so that it may come again.

        Raises:
            StorageError: The state cannot be written.
        """
        self._store.forget(key)
