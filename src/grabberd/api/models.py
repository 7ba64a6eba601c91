"""What goes in and out over HTTP, as the API's description shows it."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from grabberd.acquisition import Outcome
from grabberd.api.examples import JOB
from grabberd.api.named_types import (
    CalibrationOrigin,
    FrameTreatment,
    Glass,
    Handedness,
    ImageSize,
    JobProblem,
    JsonObject,
    LackKind,
    Latency,
    ViewCounts,
    Weights,
)
from grabberd.reconstruction.moved import RigVerdict
from grabberd.service.jobs import JobState
from grabberd.service.recovery import Rung
from grabberd.service.states import DeviceState


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


Parameter = Annotated[str, StringConstraints(pattern=r"^[0-9A-Za-z_.]{1,40}$")]


class CalibrationOptions(Document):
    """How a calibration is computed; what is left out is as `grabberd calibrate` has it."""

    weights: Weights | None = Field(
        None, description="By every mean's own σ (default), or equal ones, the paper's option."
    )
    frame: FrameTreatment | None = Field(
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
    handedness: Handedness | None = Field(None, description="Of both views; default: it is found.")


class CalibrationOrder(Document):
    """A calibration to be made from a capture of the calibration frame, or a complete one to be stored."""

    model_config = shown(
        {
            "capture": "20260301T093000125Z-barn",
            "calibration_frame": "paper-108",
            "note": "after the lens was cleaned",
        }
    )

    capture: str | None = Field(None, max_length=80, description="Id of a capture of the calibration frame.")
    calibration_frame: str | JsonObject | None = Field(
        None,
        description="Name of a calibration frame that comes with the program, or its document; "
        "not needed where there is one.",
    )
    options: CalibrationOptions | None = Field(None, description="How it is computed.")
    document: JsonObject | None = Field(None, description="A complete calibration, in place of a capture.")
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

    model_config = shown({"id": "20260301T094211003Z"})

    id: str = Field(max_length=200)
    device: str | None = Field(None, description="Name of the device; not needed where there is one.")


class CalibrationRejection(Document):
    """That a calibration was read and not accepted."""

    rejected_utc: str
    note: str


class RejectionOrder(Document):
    """Why a calibration is not accepted."""

    model_config = shown({"note": "the frame was touched while it was captured"})

    note: Annotated[str, StringConstraints(max_length=2000)] = ""


class CalibrationRow(Document):
    """A calibration as it is listed; of a damaged one only `id` and `problem` are known."""

    id: str
    device: str
    origin: CalibrationOrigin | None
    created_utc: str | None
    source: str | None
    sigma0_px: float | None
    glass: Glass | None
    image: ImageSize | None
    active: bool = Field(description="A device measures with it.")
    note: str
    capture: str | None = Field(description="The capture it was made from.")
    stored_utc: str | None
    problem: str | None
    misfit: str | None = Field(description="Why it is not one of its device's pictures as they are now.")
    rejected: CalibrationRejection | None = Field(description="Until it is activated after all.")


class CalibrationList(Document):
    """A page of the calibrations, newest first, damaged ones last."""

    calibrations: list[CalibrationRow]
    next: str | None = Next


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
    waiting: int = Field(description="Slots that its slowest reader has not read yet.")
    deepest: int = Field(description="The most that ever were, in this ring.")


class ViewColumnsDocument(Document):
    """The columns of the picture that a view has."""

    first_column: int
    end_column: int


class DeviceLackDocument(Document):
    """What keeps a device from measuring."""

    lacks: LackKind
    message: str
    hint: str


class WidthDocument(Document):
    """How far apart two targets are."""

    targets: tuple[int, int]
    width_mm: float | None = Field(description="None where one of both has no point.")
    sigma_mm: float | None = Field(description="From pointing and line jitter.")


class LiveDocument(Document):
    """The newest measured field."""

    n: int
    blobs: int
    views: ViewCounts | None = Field(description="How many targets each view shows whole.")
    points: int
    residual_px: float | None
    widths: list[WidthDocument] = Field(
        description="Of targets that face each other in the middle row, the outermost first."
    )
    latency_ms: Latency | None


class RigDocument(Document):
    """Whether camera and mirrors still are as they were calibrated, from the last seconds' pictures."""

    verdict: RigVerdict
    shift_px: float | None = Field(
        description="By how much the views have moved against each other, across the epipolar lines; what "
        "moves images along them or both alike only a check with the calibration frame can tell."
    )
    sigma_px: float | None = Field(description="What that is expected to be on a rig that has not moved.")
    ratio: float | None = Field(description="Root mean square in units of σ; 1 on a rig that has not moved.")
    residual_px: dict[str, dict[str, float | None]] = Field(
        description="Root mean square of the images' residuals, by view and axis."
    )
    targets: int
    fields: int


class DeviceDocument(Document):
    """A device at this moment."""

    name: str
    state: DeviceState
    since_utc: str
    cause: str | None
    hint: str | None = Field(description="What can be done about the cause.")
    driver: str
    stream: JsonObject | None
    signal: str
    rate_hz: float | None = Field(description="Fields that come a second; None while none do.")
    fields: dict[Outcome, int]
    openings: int
    recoveries: dict[Rung, int] = Field(
        description="How often each step was taken to have it deliver again, since the daemon started."
    )
    last_failure: str | None = Field(description="Why the last of them was taken.")
    last_failure_utc: str | None = Field(description="Since when for that reason.")
    ring: RingDocument
    views: dict[str, ViewColumnsDocument]
    calibration: ActiveCalibration | None
    lacks: list[DeviceLackDocument] = Field(description="What keeps it from measuring; the same as /readyz.")
    warnings: list[str] = Field(description="What a person has to know of it, in sentences.")
    capture_id: str | None = Field(description="The capture that is being recorded.")
    armed_capture_id: str | None = Field(description="The capture that waits for its trigger.")
    rig: RigDocument | None = Field(description="None before the first second of measuring.")
    live: LiveDocument | None


class StorageDocument(Document):
    """The disk with the captures."""

    free_bytes: int | None
    minutes_left: float | None = Field(
        description="So long all devices together can still capture, as their rings are now."
    )
    problem: str | None = Field(description="Why the disk cannot be asked.")
    removed: int = Field(description="Captures that retention has removed since the daemon started.")
    removed_bytes: int


class StateDocument(Document):
    """Everything that a glance needs."""

    version: str
    devices: dict[str, DeviceDocument]
    storage: StorageDocument


class HealthDocument(Document):
    """The daemon serves."""

    status: Literal["ok"] = "ok"
    version: str
