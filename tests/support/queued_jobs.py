"""Jobs of the tests, about nothing, and a queue that runs them."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import ClassVar, NamedTuple

from slots import ManualClock

from grabberd.archive.state.job_store import JobStore
from grabberd.documents.jobs import JobDocument, MeasurementResult
from grabberd.errors import InputError
from grabberd.fault_board import FaultBoard
from grabberd.runtime import UtcClock
from grabberd.server.daemon.jobs import KINDS
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_rows import Kinds
from grabberd.work.job_runner import MEMORY_BYTES, Contexts, JobRunner
from grabberd.work.job_spec import JobContext, JobSpec, Progress

PATIENCE_S = 60.0
SCARCE_BYTES = 1_000_000_000
OOM_SCORE = Path("/proc/self/oom_score_adj")


def counted_to(points: int) -> MeasurementResult:
    return MeasurementResult(run=1, fields=1, points=points)


class Simple(JobSpec):
    """A job about nothing."""

    kind: ClassVar[str] = "simple"
    subject: str = "nothing"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        return counted_to(0)


class Add(Simple):
    """Adds two numbers."""

    kind = "add"
    one: int = 1
    other: int = 1

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        progress(0.5)
        return counted_to(self.one + self.other)


class Niceness(Simple):
    """Tells how nice it is."""

    kind = "niceness"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        return counted_to(os.nice(0))


class OomScore(Simple):
    """Tells how soon the kernel kills it."""

    kind = "oom-score"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        return counted_to(int(OOM_SCORE.read_text()))


class Refuse(Simple):
    """Refuses its input."""

    kind = "refuse"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        raise InputError("the file is empty", "name another one")


class BreakDown(Simple):
    """Has a fault."""

    kind = "break-down"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        raise ZeroDivisionError("by nothing")


class Die(Simple):
    """Ends its process, and leaves a line in a file every time."""

    kind = "die"
    diary: str = "/dev/null"
    survives: int = 99
    """Which of its attempts is done."""

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        with Path(self.diary).open("a") as file:
            file.write(f"{context.job}\n")
        attempts = Path(self.diary).read_text().splitlines() if self.diary != "/dev/null" else []
        if len(attempts) >= self.survives:
            return counted_to(len(attempts))
        os._exit(1)


class BeKilled(Simple):
    """Is killed."""

    kind = "be-killed"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


class TakeMemory(Simple):
    """Takes more memory than there is."""

    kind = "take-memory"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        return counted_to(len(bytearray(3 * SCARCE_BYTES)))


class Hang(Simple):
    """Takes for ever."""

    kind = "hang"

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        progress(0.25)
        time.sleep(10 * PATIENCE_S)
        raise TimeoutError


class Publish(Simple):
    """Makes a file of a name that bears the job's id, whole or not at all, unless it is there."""

    kind = "publish"
    folder: str
    takes_s: float = 0.0

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        if any(Path(self.folder).glob(f"{context.job}.*")):
            return counted_to(1)
        progress(0.1)
        time.sleep(self.takes_s)
        part = Path(self.folder, f".{context.job}.{os.getpid()}")
        part.write_text("made")
        part.rename(Path(self.folder, f"{context.job}.{os.getpid()}"))
        time.sleep(self.takes_s)
        return counted_to(1)


SIMPLE_KINDS: Kinds = {
    one.kind: one
    for one in (
        *(Simple, Add, Niceness, OomScore, Refuse, BreakDown),
        *(Die, BeKilled, TakeMemory, Hang, Publish),
    )
}


def hang_in(folder: Path, told: Connection) -> None:
    """A daemon that runs a job without end, and tells the id of its job process."""
    jobs = jobs_in(folder)
    job = jobs.queue.submit(Hang())
    jobs.runner.start()
    while jobs.queue.get(job.id).progress == 0:
        time.sleep(0.01)
    assert jobs.runner.process is not None
    told.send(jobs.runner.process.pid)
    signal.pause()


class Jobs(NamedTuple):
    """A queue with what it stands on, and what runs it."""

    queue: JobQueue
    runner: JobRunner
    store: JobStore
    faults: FaultBoard


def jobs_in(
    folder: Path,
    *,
    clock: UtcClock | None = None,
    kinds: Kinds | None = None,
    context: Contexts = lambda job, spec: JobContext(job=job),
    memory_bytes: int = MEMORY_BYTES,
    ended: Callable[[JobDocument, Sequence[str]], None] = lambda job, captures: None,
    interrupt: Callable[[int], None] | None = None,
) -> Jobs:
    """The jobs of a state directory, opened but not started."""
    clock = clock or ManualClock()
    store, faults = JobStore(folder), FaultBoard(clock)

    def stop(number: int) -> None:
        runner.interrupt(number)

    kinds = {**KINDS, **SIMPLE_KINDS} if kinds is None else kinds
    queue = JobQueue(clock, store, kinds, faults, ended, interrupt or stop)
    runner = JobRunner(queue, store, context, faults, memory_bytes)
    queue.open()
    return Jobs(queue, runner, store, faults)
