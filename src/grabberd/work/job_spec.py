"""Declaration of a job: what has to be known to do it, now or after a restart; its progress, from 0 to 1."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import ConfigDict

from grabberd.documents.document import Document
from grabberd.documents.jobs import JobResult
from grabberd.documents.requests import CaptureName
from grabberd.errors import NotFound

T = TypeVar("T")

Progress = Callable[[float], None]

REPORTS = 200
"""Each report of a job is a message to the daemon; a progress bar shows no finer steps."""


def counted(items: Iterable[T], count: int, progress: Progress) -> Iterator[T]:
    """Passes the items on, and reports which share of `count` is done."""
    step = max(count // REPORTS, 1)
    for done, item in enumerate(items):
        if done % step == 0:
            progress(done / max(count, 1))
        yield item


def portion(progress: Progress, start: float, end: float) -> Progress:
    """Reports the progress of a part of the work as the span from `start` to `end` of the whole."""
    return lambda share: progress(start + (end - start) * share)


@dataclass(frozen=True, slots=True, kw_only=True)
class JobContext:
    """Surroundings of a job when it is begun, which its declaration leaves out: they may differ every time.

    Attributes:
        job: Id of the job, written into what it makes, by which its next attempt knows that it is made.
        files: Paths of the captures that it reads, by id.
        captures: Folder of the captures.
        calibrations: Folder of the `CalibrationStore`.
        folders: Folders in which jobs of extensions leave their results, by name.
        calibrator: Function that calibrates; None for that of the program.
    """

    job: str
    files: Mapping[str, Path] = field(default_factory=dict)
    captures: Path = Path()
    calibrations: Path = Path()
    folders: Mapping[str, Path] = field(default_factory=dict)
    calibrator: Callable[..., Any] | None = None

    def file(self, capture_id: str) -> Path:
        """Path of a capture.

        Raises:
            NotFound: It is none of those that the job reads.
        """
        if capture_id not in self.files:
            raise NotFound(f"no capture {capture_id!r}", "GET /api/v1/captures lists all captures")
        return self.files[capture_id]


class JobSpec(Document, ABC):
    """Declaration of a job: its name, its parameters as fields, and what it runs.

    A subclass is a document at module level: it waits on the disk as JSON, and is pickled to the job process.
    The process may be killed at any instant, and the job begins again then. So whatever `run` writes appears
    whole or not at all, and bears the job's id; before it begins, `run` looks whether it is there already.

    Attributes:
        kind: Public name of the job.
        subject: What the job works on: the id of a capture.
    """

    # Inputs from outside may hold NaN, which JSON proper lacks: as null, it would be taken for left out.
    model_config = ConfigDict(ser_json_inf_nan="constants")

    kind: ClassVar[str]
    subject: CaptureName

    @property
    def captures(self) -> tuple[str, ...]:
        """Ids of the sealed captures that it reads."""
        return (self.subject,)

    @property
    def analyses(self) -> tuple[str, ...]:
        """Ids of the captures whose analysis it makes."""
        return ()

    @abstractmethod
    def run(self, progress: Progress, context: JobContext) -> JobResult:
        """Does the work in the job process and returns the result.

        Raises:
            GrabberdError: The job fails; message and hint become its `problem`.
        """
