"""The process that runs the jobs, niced, one after the other."""

import ctypes
import multiprocessing
import os
import resource
import signal
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from grabberd.documents.job_problem import JobProblem
from grabberd.errors import GrabberdError, StorageError
from grabberd.files.directory_lock import DirectoryLock
from grabberd.files.memory import is_for_want_of_memory
from grabberd.memory import kill_first
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
