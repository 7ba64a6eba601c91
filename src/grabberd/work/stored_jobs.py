"""The store that the queue needs: jobs as rows, and the captures that could not be analysed."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, Protocol


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
    """A place where the queue outlives the daemon.

    Attributes:
        lost: Called with what was lost and where it is kept, after a damaged file was set aside.
    """

    lost: Callable[[str], None]

    @property
    def folder(self) -> Path:
        """Folder of the queue, which the process of the jobs locks."""
        ...

    def open(self) -> None:
        """Opens the queue, an empty one in place of one that is damaged.

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
