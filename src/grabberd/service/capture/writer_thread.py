"""Writing: from the capture's queue to its file, in one thread, with two commits per second."""

import contextlib
import queue
from collections.abc import Callable

from grabberd.acquisition import Slot
from grabberd.errors import StorageError
from grabberd.processes.measure import MeasuredField
from grabberd.service.capture.backlog import Backlog
from grabberd.service.clock import Clock
from grabberd.storage import CaptureWriter

COMMIT_EVERY_NS = 500_000_000
"""Bounds what a kill costs (docs/decisions/0001); not shorter, since each commit waits for the disk."""
LIVE_RUN = 1
"""Number of the run that is measured while the capture records."""
WAIT_S = 0.05
"""Longest wait for a slot or for points; the commit that falls due meanwhile is late by no more than this."""


class WriterThread:
    """Writes what has been recorded and measured until both have ended.

    Attributes:
        committed: Number of slots that are in the file for good.
        points: Number of points that have been written.
        failure: Why writing ended early, or None.
    """

    def __init__(
        self,
        writer: CaptureWriter,
        backlog: Backlog[Slot],
        clock: Clock,
        on_failure: Callable[[StorageError], None],
        on_commit: Callable[[], None] = lambda: None,
    ) -> None:
        self.committed = 0
        self.points = 0
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
