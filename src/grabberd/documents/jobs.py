"""Jobs: work that takes long."""

from typing import Any

from pydantic import Field

from grabberd.documents.document import Document, Next, with_examples
from grabberd.documents.examples import JOB
from grabberd.documents.named_types import JobProblem
from grabberd.documents.states import JobState


class JobDocument(Document):
    """A task that takes long and runs in the background."""

    model_config = with_examples(JOB)

    id: str
    kind: str
    subject: str
    state: JobState
    created_utc: str
    progress: float
    result: Any = None
    problem: JobProblem | None = Field(None, description="Message and hint of a failed job.")


class JobList(Document):
    """A page of the jobs since the daemon started, newest first."""

    jobs: list[JobDocument]
    next: str | None = Next
