"""Runs jobs one after the other in a process of its own, and tells how each of them stands."""

import itertools
import multiprocessing
import os
import resource
import signal
import threading
from abc import ABC, abstractmethod
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, ClassVar

from grabberd.acquisition.clock import UtcClock, iso_utc
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import JobProblem
from grabberd.documents.results import JobResult
from grabberd.documents.states import JobState
from grabberd.errors import Conflict, GrabberdError, NotFound
from grabberd.service.jobs.progress import Progress
from grabberd.service.memory import kill_first
from grabberd.storage.memory import is_for_want_of_memory

NICENESS = 10
"""Linux weighs it 110 against the daemon's 1024: a capture keeps nine tenths of a processor they share."""
MEMORY_BYTES = 2_000_000_000
"""Of private data, for the process: less than `MemoryMax` of the unit leaves beside the daemon, so that a job
that wants more is told so, and not killed. Addresses that libraries and threads only reserve do not count."""
KILLED_S = 10.0
"""A killed process that waits for a slow disk ends only when the disk has answered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSpec(ABC):
    """Declaration of a job: its name, its parameters as fields, and what it runs.

    A subclass is a frozen dataclass at module level, since it is pickled to the job process. The process is
    killed when the job is cancelled, so whatever `run` writes must appear whole or not at all.

    Attributes:
        kind: Public name of the job.
        subject: What the job works on: the id of a capture.
    """

    kind: ClassVar[str]
    subject: str

    @abstractmethod
    def run(self, progress: Progress) -> JobResult:
        """Does the work in the job process and returns the result.

        Raises:
            GrabberdError: The job fails; message and hint become its `problem`.
        """


ENDED = frozenset({JobState.DONE, JobState.FAILED, JobState.CANCELLED})


@dataclass(slots=True)
class _Entry:
    job: JobDocument
    spec: JobSpec


class JobRunner:
    """Runs jobs in the order they are submitted; all of them can be looked up until the daemon ends."""

    def __init__(self, clock: UtcClock, memory_bytes: int = MEMORY_BYTES) -> None:
        self._clock = clock
        self._memory_bytes = memory_bytes
        self._entries: dict[str, _Entry] = {}
        # Ids go on from the time of the start, so that a client that still polls a job from before a restart
        # gets 404 and not somebody else's job.
        self._numbers = itertools.count(int(clock.utc_now().timestamp()))
        self._changed = threading.Condition()
        self._stopping = False
        self._process: _JobProcess | None = None
        self._thread = threading.Thread(target=self._run, name="jobs", daemon=True)

    def start(self) -> None:
        """Starts taking jobs; the process starts with the first: an idle daemon does without its memory."""
        self._thread.start()

    def stop(self) -> None:
        """Kills the running job and starts no further one."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        # The thread blocks in `receive`, and only the end of the process wakes it.
        if self._process:
            self._process.kill()
        if self._thread.is_alive():
            self._thread.join(KILLED_S)

    def submit(self, spec: JobSpec) -> JobDocument:
        """Queues a job."""
        created = iso_utc(self._clock.utc_now())
        with self._changed:
            job = JobDocument(
                id=f"job-{next(self._numbers)}",
                kind=spec.kind,
                subject=spec.subject,
                state=JobState.QUEUED,
                created_utc=created,
                progress=0.0,
            )
            self._entries[job.id] = _Entry(job, spec)
            self._changed.notify_all()
        return job

    def get(self, job_id: str) -> JobDocument:
        """Returns a job as it now stands.

        Raises:
            NotFound: No job has that id.
        """
        with self._changed:
            if job_id not in self._entries:
                raise NotFound(
                    f"no job {job_id!r}", "GET /api/v1/jobs lists the jobs since the daemon started"
                )
            return self._entries[job_id].job

    def list(self) -> list[JobDocument]:
        """Returns all jobs, newest first."""
        with self._changed:
            return [entry.job for entry in reversed(self._entries.values())]

    def busy_subjects(self) -> set[str]:
        """Returns the subjects of the jobs that are queued or running."""
        return {job.subject for job in self.list() if job.state not in ENDED}

    def check_idle(self, subject: str) -> None:
        """Refuses a subject that a job still needs.

        Raises:
            Conflict: A job for it is queued or running.
        """
        for job in self.list():
            if job.subject == subject and job.state not in ENDED:
                raise Conflict(
                    f"{job.id} ({job.kind}) is working on capture {subject}",
                    f"wait for it to end, or cancel it: DELETE /api/v1/jobs/{job.id}",
                )

    def cancel(self, job_id: str) -> JobDocument:
        """Cancels a queued or running job; one that has ended stays as it is.

        Raises:
            NotFound: No job has that id.
        """
        with self._changed:
            running = self.get(job_id).state is JobState.RUNNING
            # Before the kill: the thread would otherwise report the end of the process as a failure.
            self._update(job_id, state=JobState.CANCELLED)
            if running and self._process:
                self._process.kill()
            return self.get(job_id)

    def wait(self, job_id: str, timeout_s: float) -> JobDocument:
        """Returns the job once it has ended, or as it stands after `timeout_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._entries[job_id].job.state in ENDED, timeout_s)
            return self._entries[job_id].job

    def _update(self, job_id: str, **changes: Any) -> None:
        with self._changed:
            entry = self._entries[job_id]
            if entry.job.state not in ENDED:
                entry.job = entry.job.model_copy(update=changes)
                self._changed.notify_all()

    def _run(self) -> None:
        while entry := self._next():
            self._update(entry.job.id, state=JobState.RUNNING)
            self._run_in_process(entry)
        if self._process:
            self._process.kill()

    def _next(self) -> _Entry | None:
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or self._queued())
            return None if self._stopping else self._queued()

    def _queued(self) -> _Entry | None:
        return next((one for one in self._entries.values() if one.job.state is JobState.QUEUED), None)

    def _run_in_process(self, entry: _Entry) -> None:
        if self._process is None or not self._process.alive:
            self._process = _JobProcess(self._memory_bytes)
        try:
            self._process.send(entry.spec)
            while self._receive(entry.job.id, self._process):
                pass
        except (EOFError, OSError):  # the process has ended: killed, out of memory, or crashed
            self._process.kill()
            problem = JobProblem(message=_ENDED, hint=_hint_of(self._process.exit_code))
            self._update(entry.job.id, state=JobState.FAILED, problem=problem)

    def _receive(self, job_id: str, process: "_JobProcess") -> bool:
        """Takes one message of the running job; False if it was the last."""
        message, value = process.receive()
        if message == "progress":
            self._update(job_id, progress=value)
            return True
        if message == "exhausted":  # what failed for want of memory may have left its process in any state
            process.kill()
        if message == "done":
            self._update(job_id, state=JobState.DONE, progress=1.0, result=value)
        else:
            self._update(job_id, state=JobState.FAILED, problem=value)
        return False


class _JobProcess:
    """The process that runs the jobs, as the daemon sees it."""

    def __init__(self, memory_bytes: int) -> None:
        # Spawned, not forked: a fork would copy the locks that other threads of the daemon hold at that
        # moment, and keep the device open.
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(
            target=_serve, args=(theirs, memory_bytes), name="jobs", daemon=True
        )
        self._process.start()
        kill_first(self._process.pid)
        theirs.close()  # ours of its two ends, or `receive` would never see the end of the process

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    @property
    def exit_code(self) -> int | None:
        """Exit code as of `multiprocessing`: a signal is negative; None while it runs."""
        return self._process.exitcode

    def send(self, spec: JobSpec) -> None:
        self._connection.send(spec)

    def receive(self) -> tuple[str, Any]:
        message, value = self._connection.recv()
        return message, value

    def kill(self) -> None:
        self._process.kill()
        self._process.join(KILLED_S)


_ENDED = "the job's process ended before the job was done"


def _hint_of(exit_code: int | None) -> str:
    """Advice about a process that ended by itself."""
    if exit_code == -signal.SIGKILL:
        return (
            "the system kills a job first where memory is used up (journalctl -k says so): end other "
            "programs, or let fewer fields be worked on"
        )
    return "try again; if it fails again, see the journal for why the process ended"


def _serve(connection: Connection, memory_bytes: int) -> None:
    """Runs one job after the other in the job process; ends with its parent."""
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    while True:
        try:
            spec: JobSpec = connection.recv()
        except EOFError:
            return
        connection.send(_outcome(connection, spec))


def _outcome(connection: Connection, spec: JobSpec) -> tuple[str, Any]:
    try:
        return "done", spec.run(lambda share: connection.send(("progress", share)))
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
