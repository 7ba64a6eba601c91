"""Jobs as the daemon knows them, as rows of the queue on disk, and the store that the queue needs."""

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from pydantic import TypeAdapter, ValidationError

from grabberd.documents.document import JobProblem, assembled
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import JobDocument, JobResult
from grabberd.errors import said
from grabberd.work.job_spec import JobSpec


class StoredJob(NamedTuple):
    """A job as a row of the table.

    Attributes:
        number: Its place in the order of all jobs.
        automatic: True if the daemon itself asked for it.
        ended_utc: When it ended; None until then.
        attempts: How often it was begun.
        parameters: Parameters as JSON; None once it has ended, since they may be large.
        result: Result as JSON, of a job that is done.
        problem: Problem as JSON, of a failed one.
    """

    number: int
    kind: str
    subject: str
    automatic: bool
    state: str
    created_utc: str
    ended_utc: str | None = None
    attempts: int = 0
    parameters: str | None = None
    result: str | None = None
    problem: str | None = None


class Unanalysed(NamedTuple):
    """A capture whose latest analysis came to nothing.

    Attributes:
        state: "failed" or "cancelled".
        problem: Reason as JSON.
    """

    capture: str
    state: str
    problem: str


class JobStore(Protocol):
    """A place where the queue outlives the daemon."""

    @property
    def folder(self) -> Path:
        """Folder of the queue, which the process of the jobs locks."""
        ...

    def open(self, lost: Callable[[str], None]) -> None:
        """Opens the queue; a damaged one is set aside and replaced by an empty one, now or later.

        Args:
            lost: Called with what was lost and where it is kept, whenever a damaged queue was set aside.

        Raises:
            StorageError: It cannot be read or written now.
        """
        ...

    def errors(self) -> AbstractContextManager[None]:
        """Turns errors with the file into `StorageError`, whose text an operator can act on."""
        ...

    def jobs(self) -> list[StoredJob]:
        """All jobs in the order in which they were submitted."""
        ...

    def unanalysed(self) -> list[Unanalysed]:
        """The captures that could not be analysed."""
        ...

    def put(
        self, *jobs: StoredJob, unanalysed: Iterable[Unanalysed] = (), analysed: Iterable[str] = ()
    ) -> None:
        """Writes jobs as they now stand, with what follows for their captures: all of it, or nothing."""
        ...

    def remove(self, numbers: Iterable[int]) -> None:
        """Forgets jobs."""
        ...

    def forget_capture(self, capture_id: str) -> None:
        """Forgets that a capture could not be analysed."""
        ...


Kinds = Mapping[str, type[JobSpec]]
MOST_ATTEMPTS = 3
"""A job that ends its process, or the daemon with it, so many times would do so for ever."""
ENDED = frozenset({JobState.DONE, JobState.FAILED, JobState.CANCELLED})
_CANCELLED = JobProblem(message="the analysis was cancelled", hint="analyse the capture again")
RESULT: TypeAdapter[JobResult] = TypeAdapter(JobResult)


@dataclass(frozen=True, slots=True)
class Entry:
    """A job, and its declaration until it has ended, with the characters of that as JSON."""

    number: int
    job: JobDocument
    spec: JobSpec | None = None
    size: int = 0

    @property
    def ended(self) -> bool:
        """True if nothing more happens to it."""
        return self.job.state in ENDED

    @property
    def waits(self) -> bool:
        """True until its turn comes."""
        return self.job.state is JobState.QUEUED

    @property
    def captures(self) -> frozenset[str]:
        """Captures that it is about or reads; none once it has ended."""
        if self.ended or self.spec is None:
            return frozenset()
        return frozenset((self.spec.subject, *self.spec.captures))

    def changed(self, **changes: Any) -> "Entry":
        """The job as it now stands; without its declaration once it has ended."""
        job = self.job.model_copy(update=changes)
        return Entry(self.number, job) if job.state in ENDED else replace(self, job=job)

    def had_all_attempts(self, words: str, hint: str) -> JobProblem | None:
        """Problem of a job that was interrupted in its last attempt; None if there may be another one.

        Args:
            words: What interrupted it.
            hint: What to do about that.
        """
        attempts = self.job.attempts
        if attempts < MOST_ATTEMPTS:
            return None
        return JobProblem(message=f"{words}, in each of {attempts} attempts", hint=hint)

    @property
    def analyses(self) -> tuple[str, ...]:
        """Captures whose analysis it makes; none once it has ended."""
        return () if self.ended or self.spec is None else self.spec.analyses

    def unanalysed(self, job: JobDocument) -> tuple[Unanalysed, ...]:
        """The captures that it leaves without the analysis that was asked for, by how the job ended."""
        if job.state not in (JobState.FAILED, JobState.CANCELLED):
            return ()
        problem = (job.problem or _CANCELLED).model_dump_json()
        return tuple(Unanalysed(one, job.state.value, problem) for one in self.analyses)

    def placed(self, position: int | None) -> JobDocument:
        """The job as it is shown, with its position among those that wait."""
        return self.job if position is None else self.job.model_copy(update={"position": position})

    @property
    def row(self) -> StoredJob:
        """The job as it is stored."""
        job = self.job
        return StoredJob(
            number=self.number,
            kind=job.kind,
            subject=job.subject,
            automatic=job.automatic,
            state=job.state.value,
            created_utc=job.created_utc,
            ended_utc=job.ended_utc,
            attempts=job.attempts,
            parameters=None if self.ended or self.spec is None else self.spec.model_dump_json(),
            result=None if job.result is None else job.result.model_dump_json(),
            problem=None if job.problem is None else job.problem.model_dump_json(),
        )


def id_of(number: int) -> str:
    """Public id of a job."""
    return f"job-{number}"


def entry_of(row: StoredJob, kinds: Kinds) -> Entry:
    """The job in a row; one that this program cannot read says so.

    Raises:
        ValueError: The row is none of a job.
    """
    job = assembled(
        JobDocument,
        row,
        id=id_of(row.number),
        progress=1.0 if row.state == JobState.DONE else 0.0,
        result=None,
        problem=None if row.problem is None else JobProblem.model_validate_json(row.problem),
    )
    if job.state in ENDED:
        return Entry(row.number, _with_result(job, row.result))
    try:
        kind = kinds[row.kind]
        # By Python's values: of a JSON text, the models that only describe a profile's content would be made.
        spec = kind.model_validate(json.loads(row.parameters or ""))
        return Entry(row.number, job, spec, len(row.parameters or ""))
    except KeyError:
        words = f"this program knows no job {row.kind!r}"
    except ValidationError as error:
        words = f"its parameters cannot be read: {said(error.errors()[0]['msg'])}"
    except (ValueError, RecursionError) as error:
        words = f"its parameters cannot be read: {error}"
    problem = JobProblem(message=words, hint="ask for it again; it was queued by another version of grabberd")
    failed = {"state": JobState.FAILED, "problem": problem, "ended_utc": row.created_utc}
    return Entry(row.number, job.model_copy(update=failed))


def _with_result(job: JobDocument, result: str | None) -> JobDocument:
    if result is None:
        return job
    try:
        return job.model_copy(update={"result": RESULT.validate_json(result)})
    except ValidationError:  # of another version; what it made is there all the same
        words = "its result cannot be shown: it was stored by another version of grabberd"
        return job.model_copy(update={"problem": JobProblem(message=words, hint="look at what it has made")})
