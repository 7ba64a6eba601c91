"""From the recorder's queue to the capture file: one thread, two commits a second."""

import queue
import threading
from collections.abc import Callable

from grabberd.acquisition import Slot
from grabberd.errors import StorageError
from grabberd.processes.measure import MeasuredField
from grabberd.service.backlog import Backlog
from grabberd.service.clock import Clock
from grabberd.storage import CaptureWriter

COMMIT_EVERY_NS = 500_000_000
LIVE_RUN = 1


class Writing:
    """Writes what has been recorded and measured until both have ended.

    Attributes:
        committed: how many slots are in the file for good.
        points: how many points have been written.
        all_measured: set by the worker when it has measured the last recorded field, or will not measure at
            all.
        failure: why writing ended early, or None.
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
        self.all_measured = threading.Event()
        self.failure: StorageError | None = None
        self._writer = writer
        self._backlog = backlog
        self._clock = clock
        self._on_failure = on_failure
        self._on_commit = on_commit
        self._results: queue.SimpleQueue[MeasuredField] = queue.SimpleQueue()
        self._appended = 0
        self._commit_due_ns = clock.now_ns() + COMMIT_EVERY_NS

    def add(self, measured: MeasuredField) -> None:
        """Queues one field's points; called by the worker."""
        self._results.put(measured)

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
        everything = self._backlog.closed and self.committed + self._appended == self._backlog.end
        return everything and self.all_measured.is_set() and self._results.empty()

    def _step(self) -> None:
        slots = self._backlog.from_index(self.committed + self._appended, timeout_s=0.05)
        self._writer.append(slots)
        self._appended += len(slots)
        self._append_points()
        if self._clock.now_ns() >= self._commit_due_ns or self._backlog.closed:
            self._commit()

    def _append_points(self) -> None:
        while not self._results.empty():
            measured = self._results.get()
            self._writer.append_points(LIVE_RUN, measured.n, measured.points)
            self.points += len(measured.points)

    def _commit(self) -> None:
        self._writer.commit()
        self._backlog.written(self._appended)
        self.committed += self._appended
        self._appended = 0
        self._commit_due_ns = self._clock.now_ns() + COMMIT_EVERY_NS
        self._on_commit()
