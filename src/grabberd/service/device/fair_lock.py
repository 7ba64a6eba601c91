"""A lock by which workers of several devices take turns; a capture thread waits for one of them at most."""

import threading
from collections.abc import Generator, Iterator
from typing import TypeVar

PATIENCE_S = 0.05
"""Longest wait for the lock: a field that takes another worker long costs this one no more than that."""
T = TypeVar("T")


class FairLock:
    """Lets one worker at a time measure a field.

    In one process only one thread runs Python at a time, and whoever has waited for a device, a lock or the
    disk has to queue for the interpreter again. Four workers that catch up at once would leave a capture
    thread too little of it.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()

    @property
    def is_held(self) -> bool:
        """True if a worker holds the lock."""
        return self._lock.locked()

    def one_by_one(self, fields: Iterator[T]) -> Generator[T]:
        """The same fields; the lock is held from when one has come until the next is asked for.

        It is not held while the next field is waited for: that would keep the others from theirs.
        """
        for field in fields:
            acquired = self._lock.acquire(timeout=PATIENCE_S)
            try:
                yield field
            finally:
                if acquired:
                    self._lock.release()
