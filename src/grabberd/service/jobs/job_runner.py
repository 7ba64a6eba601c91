"""What takes long runs in one niced process of its own, one job after the other, never in the daemon's
threads.

A job is a function at module level, `function(progress, **arguments) -> result`, both picklable; it reports
with `progress(share)`, share from 0 to 1. It must be safe to kill: cancelling a running job ends its
process.
"""

import itertools
import multiprocessing
import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from grabberd.documents.states import JobState
from grabberd.errors import GrabberdError, NotFound
from grabberd.service.clock import Clock, iso_utc

JobFunction = Callable[..., Any]
Progress = Callable[[float], None]

NICENESS = 10


ENDED = frozenset({JobState.DONE, JobState.FAILED, JobState.CANCELLED})


@dataclass(frozen=True, slots=True)
class Job:
    """One job as it stands; `problem` has message and hint where it failed."""

    id: str
    kind: str
    subject: str
    state: JobState
    created_utc: str
    progress: float = 0.0
    result: Any = None
    problem: Mapping[str, str] | None = None


@dataclass(slots=True)
class _Order:
    job: Job
    function: JobFunction
    arguments: Mapping[str, Any] = field(default_factory=dict)


class JobRunner:
    """Runs jobs in order; what has been asked for can be looked up until the process ends."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._orders: dict[str, _Order] = {}
        # Whoever still asks for a job of before a restart must not be told of another one.
        self._numbers = itertools.count(int(clock.utc_now().timestamp()))
        self._changed = threading.Condition()
        self._stopping = False
        self._child: _Child | None = None
        self._thread = threading.Thread(target=self._run, name="jobs", daemon=True)

    def start(self) -> None:
        """Starts taking jobs; the process itself starts with the first of them."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the running job's process and takes no further one."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        if self._child:
            self._child.kill()
        if self._thread.is_alive():
            self._thread.join(10)

    def submit(self, kind: str, subject: str, function: JobFunction, **arguments: Any) -> Job:
        """Queues a job; `subject` says what it is about, e.g. a capture's id."""
        created = iso_utc(self._clock.utc_now())
        with self._changed:
            job = Job(f"job-{next(self._numbers)}", kind, subject, JobState.QUEUED, created)
            self._orders[job.id] = _Order(job, function, arguments)
            self._changed.notify_all()
        return job

    def get(self, job_id: str) -> Job:
        """A job as it stands.

        Raises:
            NotFound: there is none of that id.
        """
        with self._changed:
            if job_id not in self._orders:
                raise NotFound(
                    f"no job {job_id!r}", "GET /api/v1/jobs lists the jobs since the daemon started"
                )
            return self._orders[job_id].job

    def list(self) -> list[Job]:
        """All jobs, the newest first."""
        with self._changed:
            return [order.job for order in reversed(self._orders.values())]

    def cancel(self, job_id: str) -> Job:
        """Cancels a job that waits or runs; one that has ended stays as it is."""
        with self._changed:
            running = self.get(job_id).state is JobState.RUNNING
            self._update(job_id, state=JobState.CANCELLED)
            if running and self._child:
                self._child.kill()
            return self.get(job_id)

    def wait(self, job_id: str, timeout_s: float) -> Job:
        """The job once it has ended, or as it stands after `timeout_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._orders[job_id].job.state in ENDED, timeout_s)
            return self._orders[job_id].job

    def _update(self, job_id: str, **changes: Any) -> None:
        with self._changed:
            order = self._orders[job_id]
            if order.job.state not in ENDED:
                order.job = replace(order.job, **changes)
                self._changed.notify_all()

    def _run(self) -> None:
        while order := self._next_order():
            self._update(order.job.id, state=JobState.RUNNING)
            self._carry_out(order)
        if self._child:
            self._child.kill()

    def _next_order(self) -> _Order | None:
        with self._changed:
            self._changed.wait_for(lambda: self._stopping or self._queued())
            return None if self._stopping else self._queued()

    def _queued(self) -> _Order | None:
        return next((o for o in self._orders.values() if o.job.state is JobState.QUEUED), None)

    def _carry_out(self, order: _Order) -> None:
        if self._child is None or not self._child.alive:
            self._child = _Child()
        try:
            self._child.send(order.function, order.arguments)
            while self._receive(order.job.id, self._child):
                pass
        except (EOFError, OSError):
            self._child.kill()
            hint = "try again; if it happens again, the journal says why the process ended"
            problem = {"message": "the process that did the job ended before it was done", "hint": hint}
            self._update(order.job.id, state=JobState.FAILED, problem=problem)

    def _receive(self, job_id: str, child: "_Child") -> bool:
        """Takes one message of the running job; False when it was the last."""
        word, value = child.receive()
        if word == "progress":
            self._update(job_id, progress=value)
            return True
        if word == "done":
            self._update(job_id, state=JobState.DONE, progress=1.0, result=value)
        else:
            self._update(job_id, state=JobState.FAILED, problem=value)
        return False


class _Child:
    """The process that carries jobs out."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process: SpawnProcess = context.Process(target=_serve, args=(theirs,), name="jobs", daemon=True)
        self._process.start()
        theirs.close()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def send(self, function: JobFunction, arguments: Mapping[str, Any]) -> None:
        self._connection.send((function, arguments))

    def receive(self) -> tuple[str, Any]:
        word, value = self._connection.recv()
        return word, value

    def kill(self) -> None:
        self._process.kill()
        self._process.join(10)


def _serve(connection: Connection) -> None:
    """Carries out one order after the other; ends with its parent."""
    os.nice(NICENESS)
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        connection.send(_answer(connection, function, arguments))


def _answer(connection: Connection, function: JobFunction, arguments: Mapping[str, Any]) -> tuple[str, Any]:
    def progress(share: float) -> None:
        connection.send(("progress", share))

    try:
        return "done", function(progress, **arguments)
    except GrabberdError as error:
        return "failed", {"message": error.message, "hint": error.hint}
    except Exception as error:
        message = f"{type(error).__name__}: {error}"
        return "failed", {"message": message, "hint": "this is a fault of the program; please report it"}
