"""Problem documents (RFC 9457)."""

from pydantic import BaseModel, ConfigDict, Field

from grabberd.documents.devices import FaultDocument, LackDocument
from grabberd.documents.examples import PROBLEM

KIND = "urn:grabberd:problem:"
"""Start of every problem's type."""


class Problem(BaseModel):
    """A problem document; `hint` tells what to do."""

    model_config = ConfigDict(json_schema_extra={"examples": [PROBLEM]})

    type: str = Field(description="Machine-readable problem type.")
    title: str
    status: int
    detail: str
    hint: str


class NotReadyProblem(Problem):
    """A device cannot measure."""

    lacks: list[LackDocument]
    faults: list[FaultDocument] = Field(description="What is wrong with the daemon itself.")


class CaptureRunningProblem(Problem):
    """Another capture is running or armed."""

    capture_id: str


class Refusal(BaseModel):
    """The reason why one device of a group cannot start."""

    device: str
    type: str
    detail: str
    hint: str


class RefusalWhileRunning(Refusal):
    """A device of a group cannot start because of another capture."""

    capture_id: str


class GroupRefusedProblem(Problem):
    """Some devices of a group cannot start, so none does."""

    refusals: list[RefusalWhileRunning | Refusal]


class Fault(BaseModel):
    """An invalid value in a request."""

    where: str
    message: str


class BadRequestProblem(Problem):
    """A request contains invalid values."""

    faults: list[Fault]
