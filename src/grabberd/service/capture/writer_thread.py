"""Writing: a capture's queue, and the thread that takes it to the file with two commits per second."""

import contextlib
import itertools
import queue
import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from grabberd.acquisition import Slot
from grabberd.acquisition.clock import UtcClock
from grabberd.errors import StorageError
from grabberd.processes.measure import MeasuredField
from grabberd.storage import CaptureWriter

T = TypeVar("T")
COMMIT_EVERY_NS = 500_000_000
"""Bounds what a kill costs (docs/decisions/0001); not shorter, since each commit waits for the disk."""
LIVE_RUN = 1
"""Number of the run that is measured while the capture records."""
WAIT_S = 0.05
"""Longest wait for a slot or for points; the commit that falls due meanwhile is late by no more than this."""


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


class WriterThread:
    """Writes what has been recorded and measured until both have ended.

    Attributes:
        committed: Number of slots that are in the file for good.
        points: Number of points that have been written.
        first_time_ns: Time of the first field that has been written; None before that.
        failure: Why writing ended early, or None.
    """

    def __init__(
        self,
        writer: CaptureWriter,
        backlog: Backlog[Slot],
        clock: UtcClock,
        on_failure: Callable[[StorageError], None],
        on_commit: Callable[[], None] = lambda: None,
    ) -> None:
        self.committed = 0
        self.points = 0
        self.first_time_ns: int | None = None
        self.failure: StorageError | None = None
        self._writer = writer
        self._backlog = backlog
        self._clock = clock
        self._on_failure = on_failure
        self._on_commit = on_commit
        # Unbounded: the worker must not wait for a disk that stalls.
        self._results: queue.SimpleQueue[MeasuredField | None] = queue.SimpleQueue()
        self._all_measured = False
        self._appended = 0
        self._commit_due_ns = clock.now_ns() + COMMIT_EVERY_NS

    def add(self, measured: MeasuredField) -> None:
        """Queues one field's points; called by the worker."""
        self._results.put(measured)

    def measuring_ended(self) -> None:
        """Ends the points: the last field has been measured, or none will be."""
        self._results.put(None)

    def run(self) -> None:
        """Writes until everything recorded has been written and measured."""
        try:
            while not self._finished():
                self._step()
            self._commit()
        except StorageError as error:
            self.failure = error
            self._on_failure(error)

    def _finished(self) -> bool:
        return self._all_recorded() and self._all_measured

    def _all_recorded(self) -> bool:
        return self._backlog.closed and self._next_index == self._backlog.end

    @property
    def _next_index(self) -> int:
        return self.committed + self._appended

    def _step(self) -> None:
        if self._all_recorded():
            self._wait_for_points()
        else:
            self._append_slots()
        while not self._results.empty():
            self._append_points(self._results.get())
        if self._clock.now_ns() >= self._commit_due_ns:
            self._commit()

    def _append_slots(self) -> None:
        slots = self._backlog.from_index(self._next_index, timeout_s=WAIT_S)
        self._writer.append(slots)
        if self.first_time_ns is None:
            self.first_time_ns = next((one.numbered.time_ns for one in slots if one.numbered), None)
        self._appended += len(slots)

    def _wait_for_points(self) -> None:
        """Sleeps while the worker measures the last fields: the worker needs the processor more."""
        with contextlib.suppress(queue.Empty):
            self._append_points(self._results.get(timeout=WAIT_S))

    def _append_points(self, measured: MeasuredField | None) -> None:
        if measured is None:
            self._all_measured = True
            return
        self._writer.append_points(LIVE_RUN, measured.n, measured.points)
        self.points += len(measured.points)

    def _commit(self) -> None:
        self._writer.commit()
        # Only now may the queue forget them: what is forgotten must be readable from the file.
        self._backlog.written(self._appended)
        self.committed += self._appended
        self._appended = 0
        self._commit_due_ns = self._clock.now_ns() + COMMIT_EVERY_NS
        self._on_commit()
