"""What goes in and out over HTTP, as the API's description shows it."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from grabberd.acquisition import Outcome
from grabberd.config import BitDepth, Lines
from grabberd.service.jobs import JobState
from grabberd.service.states import DeviceState

Label = Annotated[str, StringConstraints(max_length=200)]


class Document(BaseModel):
    """A part of a request or an answer; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class CaptureOrder(Document):
    """A capture as it is asked for: so many fields, so many seconds, or until it is stopped."""

    device: str | None = Field(None, description="Name of the device; not needed where there is one.")
    fields: int | None = Field(
        None, ge=1, le=10_000_000, description="Length in fields of 20 ms, lost ones included."
    )
    duration_s: float | None = Field(None, gt=0, le=200_000, description="Length in seconds.")
    bits: BitDepth | None = Field(None, description="Bits a pixel; default: as configured.")
    lines: Lines | None = Field(
        None, description="'doubled' (default at 1 bit) or 'field' (default for grey)."
    )
    pre_trigger_fields: int = Field(
        0, ge=0, le=4096, description="Fields before the request that belong to it."
    )
    overrun: Literal["count", "stop"] = Field(
        "count",
        description="Fields that the ring loses because the computer is too busy: count them, or stop there.",
    )
    note: Annotated[str, StringConstraints(max_length=2000)] = ""
    labels: dict[Label, Label] = Field(default_factory=dict, max_length=32, description="Cow, teat, liner, …")

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if self.fields is not None and self.duration_s is not None:
            raise ValueError("give fields or duration_s, not both")
        if self.fields is not None and self.pre_trigger_fields >= self.fields:
            raise ValueError("pre_trigger_fields are among the fields, so there have to be fewer of them")
        return self


class LedgerEntryDocument(Document):
    """Consecutive fields that did not come whole."""

    first_n: int
    count: int
    outcome: Outcome
    reason: str


class LedgerDocument(Document):
    """What became of every field that should have come."""

    complete: bool
    in_words: str
    counts: dict[Outcome, int]
    entries: list[LedgerEntryDocument]


class RunDocument(Document):
    """Points of a capture and what they were made with."""

    run: int
    kind: str
    created_utc: str
    version: str
    state: str


class CaptureDocument(Document):
    """A capture."""

    id: str
    device: str
    state: Literal["recording", "sealing", "sealed", "unsealed", "damaged"] = Field(
        description="'unsealed': the disk was too full to close it; it is sealed at the next start."
    )
    verdict: Literal["complete", "incomplete"] | None = Field(description="None while it is recording.")
    ended_because: str | None
    created_utc: str
    bits: int
    lines: str
    fields: int = Field(description="Fields that are in it.")
    ledger: LedgerDocument
    runs: list[RunDocument]
    labels: dict[str, str]
    note: str
    size_bytes: int


class CaptureList(Document):
    """The captures, newest first."""

    captures: list[CaptureDocument]


class JobDocument(Document):
    """Something that takes long."""

    id: str
    kind: str
    subject: str
    state: JobState
    created_utc: str
    progress: float
    result: Any = None
    problem: dict[str, str] | None = None


class JobList(Document):
    """The jobs since the daemon started, newest first."""

    jobs: list[JobDocument]


class RingDocument(Document):
    """The ring of a device."""

    slots: int
    bits: int
    lines: str
    threshold: int


class LiveDocument(Document):
    """The newest measured field."""

    n: int
    blobs: int
    points: int
    residual_px: float | None
    latency_ms: dict[str, float] | None


class DeviceDocument(Document):
    """A device at this moment."""

    name: str
    state: DeviceState
    since_utc: str
    cause: str | None
    driver: str
    stream: dict[str, Any] | None
    signal: str
    fields: dict[Outcome, int]
    openings: int
    ring: RingDocument
    calibration: str | None
    capture_id: str | None
    live: LiveDocument | None


class StateDocument(Document):
    """Everything that a glance needs."""

    version: str
    devices: dict[str, DeviceDocument]
    storage: dict[str, Any]


class HealthDocument(Document):
    """The daemon serves."""

    status: Literal["ok"] = "ok"
    version: str
