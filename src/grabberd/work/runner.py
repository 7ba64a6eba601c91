"""Runs the queue's jobs one after the other in a process of its own."""

import logging
import threading
from collections.abc import Callable

from grabberd.documents.job_problem import JobProblem
from grabberd.documents.states import JobState
from grabberd.errors import Cause, GrabberdError, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.work.job_process import KILLED_S, MEMORY_BYTES, JobProcess, hint_of
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_rows import Entry
from grabberd.work.job_spec import JobContext, JobSpec
from grabberd.work.stored_jobs import JobStore

log = logging.getLogger(__name__)

AGAIN_S = 5.0
"""Time until the disk is tried again, once it could not be written."""
_ENDED = "the job's process ended before the job was done"

Contexts = Callable[[str, JobSpec], JobContext]


class JobRunner:
    """A thread that takes the queue's first job, and a process that does it.

    Args:
        queue: The jobs.
        store: Their place on the disk, whose folder the process locks.
        context: Surroundings of a job that begins, by its id and declaration.
        faults: Where a disk that cannot be written is told.
        memory_bytes: Most private data of the process.

    Attributes:
        process: The process; None before the first job.
    """

    def __init__(
        self,
        queue: JobQueue,
        store: JobStore,
        context: Contexts,
        faults: FaultBoard | None = None,
        memory_bytes: int = MEMORY_BYTES,
    ) -> None:
        self._queue = queue
        self._folder = store.folder
        self._context = context
        self._faults = faults or FaultBoard()
        self._memory_bytes = memory_bytes
        self._stopping = threading.Event()
        self.process: JobProcess | None = None
        # Whose job the process has, so that no other is killed in its place.
        self._having = threading.Lock()
        self._number: int | None = None
        self._thread = threading.Thread(target=self._run, name="jobs", daemon=True)
        queue.interrupt = self._interrupt

    @property
    def alive(self) -> bool:
        """True while jobs are taken."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Starts taking jobs; the process starts with the first: an idle daemon does without its memory."""
        self._thread.start()

    def stop(self) -> None:
        """Kills the running job, which begins anew with the next start, and starts no further one."""
        self._stopping.set()
        self._queue.wake()
        # The thread blocks in `receive`, and only the end of the process wakes it.
        self._kill()
        if self._thread.is_alive():
            self._thread.join(KILLED_S)

    def _interrupt(self, number: int) -> None:
        with self._having:
            if self.process is not None and self._number == number:
                self.process.kill()

    def _run(self) -> None:
        while (entry := self._queue.first(self._stopping.is_set)) is not None:
            try:
                begun = self._queue.begin(entry.number)
            except StorageError as error:  # without a count of its attempts no job begins
                self._await_the_disk(error)
                continue
            self._faults.resolve(Cause.JOBS_UNWRITABLE)
            if begun is not None and begun.spec is not None:
                self._do(begun, begun.spec)
        self._kill()

    def _do(self, entry: Entry, spec: JobSpec) -> None:
        try:
            context = self._context(entry.job.id, spec)
        except GrabberdError as error:  # its capture was deleted meanwhile, or is not to be had now
            problem = JobProblem(message=error.message, hint=error.hint)
            self._surely(lambda: self._queue.end(entry.number, JobState.FAILED, problem=problem))
            return
        try:
            process = self._process_for(entry.number)
            process.send(spec, context)
            while self._receive(entry.number, process):
                pass
        except (EOFError, OSError):  # the process has ended: killed, out of memory, or crashed
            hint = hint_of(self._kill())
            self._surely(lambda: self._after_its_end(entry.number, hint))

    def _process_for(self, number: int) -> JobProcess:
        with self._having:
            if self._stopping.is_set():
                raise EOFError
            if self.process is None or not self.process.alive:
                self.process = JobProcess(self._memory_bytes, self._folder)
            self._number = number
            return self.process

    def _kill(self) -> int | None:
        """Ends the process; returns its exit code, if there is one."""
        with self._having:
            if self.process is None:
                return None
            self.process.kill()
            return self.process.exit_code

    def _receive(self, number: int, process: JobProcess) -> bool:
        """Takes one message of the running job; False if it was the last."""
        message, value = process.receive()
        if message == "progress":
            self._queue.progress(number, value)
            return True
        if message == "exhausted":  # what failed for want of memory may have left its process in any state
            process.kill()
        if message == "done":
            self._surely(lambda: self._queue.end(number, JobState.DONE, progress=1.0, result=value))
        else:
            self._surely(lambda: self._queue.end(number, JobState.FAILED, problem=value))
        return False

    def _after_its_end(self, number: int, hint: str) -> None:
        if self._stopping.is_set():
            self._queue.put_back(number)
        elif self._queue.interrupted(number, _ENDED, hint):
            log.warning("job-%d: %s; it begins again", number, _ENDED)

    def _surely(self, write: Callable[[], None]) -> None:
        """Writes as soon as the disk allows it; if the daemon ends before that, the job begins again."""
        while True:
            try:
                write()
                self._faults.resolve(Cause.JOBS_UNWRITABLE)
            except StorageError as error:
                if self._await_the_disk(error):
                    continue
            return

    def _await_the_disk(self, error: StorageError) -> bool:
        """Tells of the fault and waits a while; False if the daemon ends."""
        self._faults.report(Cause.JOBS_UNWRITABLE, f"jobs wait: {error.message}", error.hint)
        return not self._stopping.wait(AGAIN_S)
