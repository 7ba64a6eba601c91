"""What goes in and out over HTTP, as the API's description shows it."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from grabberd.api.docs.examples import JOB
from grabberd.api.routes.named_types import (
    JobProblem,
)
from grabberd.service.jobs.runner import JobState


class Document(BaseModel):
    """A part of a request or an answer; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def shown(*examples: Any) -> ConfigDict:
    """A document's configuration with examples that its description shows."""
    return ConfigDict(json_schema_extra={"examples": list(examples)})


Next = Field(None, description="`cursor` of the next page; None after the last.")


class JobDocument(Document):
    """Something that takes long."""

    model_config = shown(JOB)

    id: str
    kind: str
    subject: str
    state: JobState
    created_utc: str
    progress: float
    result: Any = None
    problem: JobProblem | None = Field(None, description="Its message and hint, where it failed.")


class JobList(Document):
    """A page of the jobs since the daemon started, newest first."""

    jobs: list[JobDocument]
    next: str | None = Next
