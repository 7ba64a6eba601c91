"""Calibrations and the calibration frames they are made from."""

from pydantic import Field

from grabberd.documents.document import Document, Next
from grabberd.documents.named_types import CalibrationOrigin, Glass, ImageSize


class CalibrationRejection(Document):
    """A record that somebody read a calibration and did not accept it."""

    rejected_utc: str
    note: str


class CalibrationRow(Document):
    """A calibration in a list; of a damaged one only `id` and `problem` are known."""

    id: str
    device: str
    origin: CalibrationOrigin | None
    created_utc: str | None
    source: str | None
    sigma0_px: float | None
    glass: Glass | None
    image: ImageSize | None
    active: bool = Field(description="True if a device measures with it.")
    note: str
    capture: str | None = Field(description="The capture it was made from.")
    stored_utc: str | None
    problem: str | None
    misfit: str | None = Field(description="Why it does not fit its device's present video format.")
    rejected: CalibrationRejection | None = Field(
        description="Its rejection, which activating the calibration takes back."
    )


class CalibrationList(Document):
    """A page of the calibrations, newest first, damaged ones last."""

    calibrations: list[CalibrationRow]
    next: str | None = Next


class ActiveCalibration(Document):
    """The calibration that a device measures with."""

    id: str
    created_utc: str
    age_days: float
    activated_utc: str | None = Field(
        description="Null for the configuration's calibration, which needs no activation."
    )


class CalibrationFrameRow(Document):
    """A calibration frame that comes with the program."""

    name: str
    targets: int
    target_diameter_mm: float
    size_mm: list[float] = Field(
        description="Distances between the centres of the outermost targets, the long side first."
    )


class CalibrationFrameList(Document):
    """The calibration frames that come with the program, by name."""

    calibration_frames: list[CalibrationFrameRow]
