"""Jobs: work that takes long."""

from pydantic import Field

from grabberd.documents.document import Document, Next, with_examples
from grabberd.documents.examples import JOB
from grabberd.documents.problems import JobProblem
from grabberd.documents.results import JobResult
from grabberd.documents.states import JobState


class JobDocument(Document):
    """A task that takes long and runs in the background."""

    model_config = with_examples(JOB)

    id: str
    kind: str = Field(description="analyse, calibrate, check, identify or measure.")
    subject: str = Field(description="Id of the capture that it works on.")
    state: JobState
    created_utc: str
    progress: float = Field(description="Share of the work that is done, from 0 to 1.")
    result: JobResult | None = Field(
        None, description="Result of a job that is done; its keys follow from `kind`."
    )
    problem: JobProblem | None = Field(None, description="Message and hint of a failed job.")


class JobList(Document):
    """A page of the jobs since the daemon started, newest first."""

    jobs: list[JobDocument]
    next: str | None = Next
