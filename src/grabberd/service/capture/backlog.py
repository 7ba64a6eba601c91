"""Queue of a capture: slots that have been recorded and not yet been written or measured."""

import itertools
import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Backlog(Generic[T]):
    """An append-only list that forgets its head once it is on disk; indices count from the first item ever.

    The writer must not fall behind by more than `capacity` items: then `append` refuses. The measuring
    worker may fall behind as far as it likes: it reads from the file what has been forgotten meanwhile.

    Attributes:
        capacity: Number of items that the writer may fall behind.
        deepest: The most items that ever waited for the writer.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.deepest = 0
        self._items: deque[T] = deque()
        self._first = 0
        self._written = 0
        self._closed = False
        self._changed = threading.Condition()

    @property
    def end(self) -> int:
        """Index after the last item."""
        with self._changed:
            return self._end()

    @property
    def closed(self) -> bool:
        """True if nothing will be appended any more."""
        return self._closed

    def append(self, item: T) -> bool:
        """Appends an item; returns False, and appends nothing, if the writer is `capacity` items behind."""
        with self._changed:
            waiting = self._end() - self._written
            if waiting >= self.capacity:
                return False
            self._items.append(item)
            self.deepest = max(self.deepest, waiting + 1)
            self._changed.notify_all()
            return True

    def close(self) -> None:
        """Ends the list: nothing will be appended any more; whoever waits is woken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def room(self) -> int:
        """Number of items that the writer may still fall behind."""
        with self._changed:
            return self.capacity - (self._end() - self._written)

    def from_index(self, index: int, timeout_s: float) -> list[T]:
        """All items from an index on that is not forgotten; waits up to `timeout_s` for the first of them."""
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            return list(itertools.islice(self._items, index - self._first, None))

    def written(self, count: int) -> None:
        """Marks the next `count` items as on disk; all but the latest `capacity` of them are forgotten."""
        with self._changed:
            self._written += count
            # The latest stay in memory for the worker, which reads the file only for what is forgotten.
            while self._first < self._written and len(self._items) > self.capacity:
                self._items.popleft()
                self._first += 1
            self._changed.notify_all()

    def at(self, index: int, timeout_s: float) -> T | None:
        """The item at an index; None if it does not come in time, or never will.

        Raises:
            LookupError: It has been forgotten; it is on disk.
        """
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            if index < self._first:
                raise LookupError(f"item {index} is forgotten, the oldest is {self._first}")
            return self._items[index - self._first] if index < self._end() else None

    def oldest(self) -> tuple[int, T]:
        """Index of the oldest item that is not forgotten, and the item.

        Raises:
            LookupError: Nothing was ever appended.
        """
        with self._changed:
            if not self._items:
                raise LookupError("nothing was ever appended")
            return self._first, self._items[0]

    def _end(self) -> int:
        return self._first + len(self._items)
