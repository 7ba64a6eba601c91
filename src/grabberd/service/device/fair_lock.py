"""Workers of several devices measure one after the other: a capture thread waits for one of them at most."""

import threading
from collections.abc import Generator, Iterator
from typing import TypeVar

PATIENCE_S = 0.05
"""So long at most a worker waits for its turn: a field that takes another one long costs it no more."""
T = TypeVar("T")


class FairLock:
    """What workers take turns by.

    In one process only one thread runs Python at a time, and whoever has waited for a device, a lock or the
    disk has to get in line again. Four workers that catch up at once would leave a capture thread too little.
    """

    def __init__(self) -> None:
        self._turn = threading.Lock()

    @property
    def is_taken(self) -> bool:
        """Whether it is somebody's turn."""
        return self._turn.locked()

    def of(self, fields: Iterator[T]) -> Generator[T]:
        """The same fields; it is its turn from when it has got one until it asks for the next."""
        for field in fields:
            mine = self._turn.acquire(timeout=PATIENCE_S)
            try:
                yield field
            finally:
                if mine:
                    self._turn.release()
