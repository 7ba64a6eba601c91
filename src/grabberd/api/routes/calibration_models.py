"""What goes in and out about calibrations."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.api.routes.models import Document, Next, shown
from grabberd.api.routes.named_types import (
    CalibrationOrigin,
    FrameTreatment,
    Glass,
    Handedness,
    ImageSize,
    JsonObject,
    Weights,
)

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
