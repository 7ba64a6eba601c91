"""What goes in and out over HTTP, as the API's description shows it."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from grabberd.acquisition import Outcome
from grabberd.config import BitDepth, Lines, OnInterruption
from grabberd.service.jobs import JobState
from grabberd.service.recovery import Rung
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
    on_interruption: OnInterruption | None = Field(
        None,
        description="When the device fails to deliver: 'continue' with the gap in the ledger, or 'end'; "
        "default: as configured.",
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


Parameter = Annotated[str, StringConstraints(pattern=r"^[0-9A-Za-z_.]{1,40}$")]


class CalibrationOptions(Document):
    """How a calibration is computed; what is left out is as `grabberd calibrate` has it."""

    weights: Literal["honest", "equal"] | None = Field(
        None, description="By every mean's own σ (default), or equal ones, the paper's option."
    )
    frame: Literal["weighted", "held"] | None = Field(
        None, description="Calibration-frame points by their σ (default), or held."
    )
    shared: bool | list[Parameter] | None = Field(
        None, description="Lens parameters that both views have in common: all, none (default), or these."
    )
    tied: bool | None = Field(None, description="b9 = b8, the paper's own model.")
    free: list[Parameter] | None = Field(
        None, max_length=100, description="Parameters to be adjusted, e.g. 'b3' or 'left.b3'; default: all."
    )
    alpha: float | None = Field(None, gt=0, lt=1, description="Of the tests for significance.")
    local_field: bool | None = Field(
        None, description="Whether a smooth field of residuals may be added to the model."
    )
    handedness: Literal[-1, 1] | None = Field(None, description="Of both views; default: it is found.")


class CalibrationOrder(Document):
    """A calibration to be made from a capture of the calibration frame, or a complete one to be stored."""

    capture: str | None = Field(None, max_length=80, description="Id of a capture of the calibration frame.")
    calibration_frame: str | dict[str, Any] | None = Field(
        None,
        description="Name of a calibration frame that comes with the program, or its document; "
        "not needed where there is one.",
    )
    options: CalibrationOptions | None = Field(None, description="How it is computed.")
    document: dict[str, Any] | None = Field(
        None, description="A complete calibration, in place of a capture."
    )
    device: str | None = Field(
        None, description="Whose calibration it is; default: the capture's. Not needed where there is one."
    )
    note: Annotated[str, StringConstraints(max_length=2000)] = ""

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if (self.capture is None) == (self.document is None):
            raise ValueError("give capture or document, one of them")
        if self.document is not None and (self.options or self.calibration_frame):
            raise ValueError("options and calibration_frame belong to a capture, not to a document")
        return self


class CalibrationChoice(Document):
    """The calibration that a device is to measure with."""

    id: str = Field(max_length=200)
    device: str | None = Field(None, description="Name of the device; not needed where there is one.")


class CalibrationRow(Document):
    """A calibration as it is listed; of a damaged one only `id` and `problem` are known."""

    id: str
    device: str
    origin: Literal["capture", "import", "configuration"] | None
    created_utc: str | None
    source: str | None
    sigma0_px: float | None
    glass: dict[str, float] | None
    image: dict[str, int] | None
    active: bool = Field(description="A device measures with it.")
    note: str
    capture: str | None = Field(description="The capture it was made from.")
    stored_utc: str | None
    problem: str | None


class CalibrationList(Document):
    """The calibrations, newest first, damaged ones last."""

    calibrations: list[CalibrationRow]


class ActiveCalibration(Document):
    """The calibration that a device measures with."""

    id: str
    created_utc: str
    age_days: float
    activated_utc: str | None = Field(description="None for the configuration's, in force by itself.")


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
    hint: str | None = Field(description="What can be done about the cause.")
    driver: str
    stream: dict[str, Any] | None
    signal: str
    fields: dict[Outcome, int]
    openings: int
    recoveries: dict[Rung, int] = Field(
        description="How often each step was taken to have it deliver again, since the daemon started."
    )
    last_failure: str | None = Field(description="Why the last of them was taken.")
    last_failure_utc: str | None = Field(description="Since when for that reason.")
    ring: RingDocument
    calibration: ActiveCalibration | None
    warnings: list[str] = Field(description="What a person has to know of it, in sentences.")
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
