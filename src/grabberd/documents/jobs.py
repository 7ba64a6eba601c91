"""Jobs: work that takes long."""

from pydantic import Field

from grabberd.documents.document import Document, JobProblem, Next, with_examples
from grabberd.documents.enums import JobState
from grabberd.documents.examples import JOB
from grabberd.documents.results import JobResult


class JobDocument(Document):
    """A task that takes long and runs in the background."""

    model_config = with_examples(JOB)

    id: str
    kind: str = Field(description="analyse, calibrate, check, identify or measure.")
    subject: str = Field(description="Id of the capture that it works on.")
    automatic: bool = Field(
        False, description="True if the daemon queued it by itself, as it does when a capture is sealed."
    )
    state: JobState
    position: int | None = Field(
        None, description="Position among the jobs that wait, from 1; null once it runs or has ended."
    )
    attempts: int = Field(
        0,
        description="How often it was begun: it begins again if the daemon or its process is killed, and "
        "fails after the third time.",
    )
    created_utc: str
    ended_utc: str | None = Field(None, description="Null until it has ended.")
    progress: float = Field(
        description="Share of the present attempt's work that is done, from 0 to 1; 0 while it waits."
    )
    result: JobResult | None = Field(
        None, description="Result of a job that is done; its keys follow from `kind`."
    )
    problem: JobProblem | None = Field(None, description="Message and hint of a failed job.")


class JobList(Document):
    """A page of the jobs, newest first: those that wait or run, and those that ended in the last month."""

    jobs: list[JobDocument]
    next: str | None = Next
