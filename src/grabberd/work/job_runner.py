"""Runs the queue's jobs one after the other, in a niced process of their own."""

import logging
import resource
import signal
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from grabberd import runtime
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.errors import Cause, GrabberdError, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import DirectoryLock, is_for_want_of_memory
from grabberd.work.child import Limits
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_rows import RESULT, Entry, JobStore
from grabberd.work.job_spec import JobContext, JobSpec, Progress
from grabberd.work.process import KILLED_S, NoAnswer, Process

NICENESS = 10
"""Linux weighs it 110 against the daemon's 1024: a capture keeps nine tenths of a processor they share."""
MEMORY_BYTES = 2_000_000_000
"""Of private data, for the process: less than `MemoryMax` of the unit leaves beside the daemon, so that a job
that wants more fails with the reason, and is not killed. Addresses that libraries and threads only reserve do
not count."""
ALONE_S = 60.0
"""Time that a process waits for an earlier one to end, such as that of a daemon that was killed."""
_POLL_S = 0.05


def hint_of(exit_code: int | None) -> str:
    """Advice about a process that ended by itself."""
    if exit_code == -signal.SIGKILL:
        return (
            "the system kills a job first where memory is used up (journalctl -k says so): end other "
            "programs, or let fewer fields be worked on"
        )
    return "try again; if it fails again, see the journal for why the process ended"


def run_job(spec: JobSpec, context: JobContext, folder: Path, progress: Progress) -> dict[str, Any]:
    """Does a job in the job process; the state that it ends in, and its result or problem as JSON.

    Args:
        spec: The job.
        context: See `JobSpec.run`.
        folder: Folder that the process locks, so that there is never a second one.
        progress: See `JobSpec.run`.
    """
    problem = _refusal_of_a_second(folder)
    if problem is None:
        try:
            return {"state": "done", "result": spec.run(progress, context).model_dump_json()}
        except GrabberdError as error:
            problem = JobProblem(message=error.message, hint=error.hint)
        except Exception as error:
            if is_for_want_of_memory(error):
                return {"state": "exhausted", "problem": _too_large().model_dump_json()}
            message = f"{type(error).__name__}: {error}"
            problem = JobProblem(message=message, hint=_REPORT)
    return {"state": "failed", "problem": problem.model_dump_json()}


@cache
def _lock_of(folder: Path) -> DirectoryLock:
    return DirectoryLock(folder)


def _refusal_of_a_second(folder: Path) -> JobProblem | None:
    """Problem while an earlier process runs, which even a killed one does until its disk has answered."""
    lock, until_s = _lock_of(folder), runtime.monotonic() + ALONE_S
    while True:
        try:
            lock.acquire()
            return None
        except StorageError as error:
            if runtime.monotonic() > until_s:
                waited = f"the process of an earlier job has not ended within {ALONE_S:g} s: {error.message}"
                return JobProblem(message=waited, hint="see whether its disk hangs, then try again")
        runtime.sleep(_POLL_S)


def _too_large() -> JobProblem:
    most, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return JobProblem(
        message=f"the job needs more memory than a job may have, {most / 1e9:g} GB",
        hint="let fewer fields be worked on, such as those of a shorter capture, or run the command of the "
        "same name on the file: commands have no such limit",
    )


log = logging.getLogger(__name__)

AGAIN_S = 5.0
"""Time until the disk is tried again, once it could not be written."""
RUN = f"{__name__}:run_job"
_REPORT = "this is a fault of the program; please report it"
_ENDED = "the job's process ended before the job was done"

Contexts = Callable[[str, JobSpec], JobContext]


class JobRunner:
    """A thread that takes the queue's first job, and a process that does it.

    Args:
        queue: The jobs.
        store: Their place on the disk, whose folder the process locks.
        context: Surroundings of a job that begins, by its id and declaration.
        faults: Where a disk that cannot be written is reported.
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
        self._stopping = runtime.event()
        self.process: Process | None = None
        # Whose job the process has, so that no other is killed in its place.
        self._having = runtime.lock()
        self._number: int | None = None
        self._thread = runtime.Thread(target=self._run, name="jobs", daemon=True)

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
        # The thread waits for an answer, and only the end of the process wakes it.
        self._kill()
        if self._thread.is_alive():
            self._thread.join(KILLED_S)

    def interrupt(self, number: int) -> None:
        """Kills the process if it has the job of this number."""
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
        if self.process is not None:
            self.process.close()

    def _do(self, entry: Entry, spec: JobSpec) -> None:
        try:
            context = self._context(entry.job.id, spec)
        except GrabberdError as error:  # its capture was deleted meanwhile, or is not to be had now
            problem = JobProblem(message=error.message, hint=error.hint)
            self._surely(lambda: self._queue.end(entry.number, JobState.FAILED, problem=problem))
            return
        try:
            process = self._process_for(entry)
            progress = partial(self._queue.progress, entry.number)
            ended = process.call(RUN, spec, context, self._folder, progress=progress)
        except (NoAnswer, OSError):  # the process has ended: killed, out of memory, or crashed
            hint = hint_of(self._kill())
            self._surely(lambda: self._after_its_end(entry.number, hint))
        except (GrabberdError, RuntimeError) as error:  # it could not be begun, or its end not reported
            self._kill()
            hint = error.hint if isinstance(error, GrabberdError) else _REPORT
            why = JobProblem(message=str(getattr(error, "message", error)), hint=hint)
            self._surely(lambda: self._queue.end(entry.number, JobState.FAILED, problem=why))
        else:
            self._end(entry.number, **ended)

    def _process_for(self, entry: Entry) -> Process:
        with self._having:
            if self._stopping.is_set():
                raise NoAnswer
            if self.process is not None and not self.process.alive:
                self.process.close()
                self.process = None
            if self.process is None:
                limits = Limits(niceness=NICENESS, data_bytes=self._memory_bytes)
                # An orphan would go on beside its successor.
                self.process = Process(limits, end_with_parent=True)
            self._number = entry.number
            if self._queue.get(entry.job.id).state is not JobState.RUNNING:
                raise NoAnswer  # cancelled since it began, when there was nothing to interrupt yet
            return self.process

    def _kill(self) -> int | None:
        """Ends the process; returns its exit code, if there is one."""
        with self._having:
            if self.process is None:
                return None
            self.process.kill()
            return self.process.exit_code

    def _end(self, number: int, state: str, result: str = "", problem: str = "") -> None:
        if state == "exhausted":  # what failed for want of memory may have left its process in any state
            self._kill()
        if state == "done":
            made = RESULT.validate_json(result)
            self._surely(lambda: self._queue.end(number, JobState.DONE, progress=1.0, result=made))
        else:
            why = JobProblem.model_validate_json(problem)
            self._surely(lambda: self._queue.end(number, JobState.FAILED, problem=why))

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
