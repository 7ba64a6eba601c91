"""Runs the queue's jobs one after the other, in a niced process of their own."""

import ctypes
import logging
import multiprocessing
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.errors import Cause, GrabberdError, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import DirectoryLock, is_for_want_of_memory
from grabberd.memory import kill_first
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_rows import Entry, JobStore
from grabberd.work.job_spec import JobContext, JobSpec

NICENESS = 10
"""Linux weighs it 110 against the daemon's 1024: a capture keeps nine tenths of a processor they share."""
MEMORY_BYTES = 2_000_000_000
"""Of private data, for the process: less than `MemoryMax` of the unit leaves beside the daemon, so that a job
that wants more is told so, and not killed. Addresses that libraries and threads only reserve do not count."""
KILLED_S = 10.0
"""A killed process that waits for a slow disk ends only when the disk has answered."""
ALONE_S = 60.0
"""Time that a process waits for an earlier one to end, such as that of a daemon that was killed."""
_POLL_S = 0.05
_PR_SET_PDEATHSIG = 1


class JobProcess:
    """The process that runs the jobs, as the daemon sees it.

    Args:
        memory_bytes: Most private data of the process.
        folder: Folder that it locks, so that there is never a second one.
    """

    def __init__(self, memory_bytes: int, folder: Path) -> None:
        # Spawned, not forked: a fork would copy the locks that other threads of the daemon hold at that
        # moment, and keep the device open.
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(
            target=_serve, args=(theirs, memory_bytes, folder, os.getpid()), name="jobs", daemon=True
        )
        self._process.start()
        kill_first(self._process.pid)
        self._killed = False
        theirs.close()  # ours of its two ends, or `receive` would never see the end of the process

    @property
    def alive(self) -> bool:
        """True until it has ended, or is about to."""
        return not self._killed and self._process.is_alive()

    @property
    def pid(self) -> int | None:
        """Id of the process."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code as of `multiprocessing`: a signal is negative; None while it runs."""
        return self._process.exitcode

    def send(self, spec: JobSpec, context: JobContext) -> None:
        """Begins a job.

        Raises:
            OSError: The process has ended.
        """
        self._connection.send((spec, context))

    def receive(self) -> tuple[str, Any]:
        """Waits for the next message about the running job: its kind, and its value.

        Raises:
            EOFError, OSError: The process has ended.
        """
        message, value = self._connection.recv()
        return message, value

    def kill(self) -> None:
        """Ends it at once."""
        self._killed = True
        self._process.kill()
        self._process.join(KILLED_S)


def hint_of(exit_code: int | None) -> str:
    """Advice about a process that ended by itself."""
    if exit_code == -signal.SIGKILL:
        return (
            "the system kills a job first where memory is used up (journalctl -k says so): end other "
            "programs, or let fewer fields be worked on"
        )
    return "try again; if it fails again, see the journal for why the process ended"


def _serve(connection: Connection, memory_bytes: int, folder: Path, parent: int) -> None:
    """Runs one job after the other in the job process; ends with its parent."""
    _end_with(parent)
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    lock = DirectoryLock(folder)
    while True:
        try:
            spec, context = connection.recv()
        except EOFError:
            return
        connection.send(_refusal_of_a_second(lock) or _outcome(connection, spec, context))


def _end_with(parent: int) -> None:
    """Lets the kernel kill this process with its parent: an orphan would go on beside its successor."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended before that
        os._exit(1)


def _refusal_of_a_second(lock: DirectoryLock) -> tuple[str, JobProblem] | None:
    """Answer while an earlier process runs, which even a killed one does until its disk has answered."""
    until_s = time.monotonic() + ALONE_S
    while True:
        try:
            lock.acquire()
            return None
        except StorageError as error:
            if time.monotonic() > until_s:
                waited = f"the process of an earlier job has not ended within {ALONE_S:g} s: {error.message}"
                return "failed", JobProblem(message=waited, hint="see whether its disk hangs, then try again")
        time.sleep(_POLL_S)


def _outcome(connection: Connection, spec: JobSpec, context: JobContext) -> tuple[str, Any]:
    try:
        return "done", spec.run(lambda share: connection.send(("progress", share)), context)
    except GrabberdError as error:
        return "failed", JobProblem(message=error.message, hint=error.hint)
    except Exception as error:
        if is_for_want_of_memory(error):
            return "exhausted", _too_large()
        message = f"{type(error).__name__}: {error}"
        return "failed", JobProblem(message=message, hint="this is a fault of the program; please report it")


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
