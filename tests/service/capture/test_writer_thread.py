"""The writing of one capture: what it waits for, and how seldom it commits."""

import threading
from pathlib import Path

from slots import ManualClock, slot

from grabberd.acquisition import Ledger, Slot
from grabberd.processes.measure import MeasuredField
from grabberd.service.capture.backlog import Backlog
from grabberd.service.capture.writer_thread import LIVE_RUN, WAIT_S, WriterThread
from grabberd.storage import CaptureWriter
from storage.captures import meta, points

PATIENCE_S = 30.0


class Written:
    """Three recorded fields that the writer has while the worker still measures them."""

    def __init__(self, folder: Path) -> None:
        self.commits = 0
        self.told = threading.Event()
        backlog: Backlog[Slot] = Backlog(10)
        for n in range(3):
            backlog.append(slot(n))
        backlog.close()
        self.file = CaptureWriter.create(folder / "one.grab.part", meta())
        self.file.begin_run(LIVE_RUN, "live", "2026-01-01T00:00:00.000Z", "0", {})
        self.clock = ManualClock()
        self.writing = WriterThread(self.file, backlog, self.clock, self._failed, self._committed)
        self.thread = threading.Thread(target=self.writing.run)
        self.thread.start()

    def _failed(self, error: Exception) -> None:
        raise error

    def _committed(self) -> None:
        self.commits += 1
        self.told.set()

    def measured(self, n: int) -> None:
        self.writing.add(MeasuredField(n, n, (), points(n)))  # type: ignore[arg-type]

    def end(self) -> None:
        self.writing.measuring_ended()
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive()
        self.file.seal(Ledger(), complete=True, ended_because="")


def test_it_sleeps_while_the_worker_has_the_last_fields(tmp_path: Path) -> None:
    written = Written(tmp_path)
    for n in range(3):
        written.thread.join(2 * WAIT_S)
        assert written.thread.is_alive(), "it waits for the worker"
        written.measured(n)
    written.end()
    assert written.commits == 1, "without time passing nothing is due but the last"
    assert written.writing.committed == 3
    assert written.writing.points == sum(len(points(n)) for n in range(3))


def test_what_is_due_is_committed_while_it_waits(tmp_path: Path) -> None:
    written = Written(tmp_path)
    written.clock.advance(1.0)
    assert written.told.wait(PATIENCE_S)
    assert written.writing.committed == 3
    written.end()


def test_it_ends_at_once_when_the_worker_has(tmp_path: Path) -> None:
    written = Written(tmp_path)
    written.end()
    assert written.writing.points == 0
