"""Calibrations and the calibration frames they are made from."""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import (
    AcceptanceVerdict,
    CalibrationOrigin,
    Document,
    Glass,
    ImageSize,
    JsonObject,
    Next,
)


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
    verdict: AcceptanceVerdict | None = Field(
        description="Verdict of its acceptance; null for one that was not made here."
    )
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


class UnusableFrame(Document):
    """A file of a calibration frame that cannot be used."""

    name: str
    problem: str = Field(description="What is wrong with the file.")
    hint: str = Field(description="What to do about it.")


class CalibrationFrameList(Document):
    """A page of the calibration frames that can be selected, by name."""

    calibration_frames: list[CalibrationFrameRow]
    unusable: list[UnusableFrame] = Field(description="Files between them that cannot be used.")
    next: str | None = Next


class LocalFieldDocument(Document):
    """Displacement field of a view beyond the functional model, at the nodes of a grid, in frame pixels."""

    origin_px: tuple[float, float]
    step_px: float
    x_px: list[list[float]]
    y_px: list[list[float]]
    sigma_x_px: list[list[float]]
    sigma_y_px: list[list[float]]


class CalibratedView(Document):
    """A virtual camera: interior and exterior orientation and the distortion b1 to b9."""

    first_column: int
    end_column: int
    pixel_x_mm: float
    pixel_y_mm: float
    handedness: int = Field(description="-1 where an odd number of mirrors makes the view left-handed.")
    f_mm: float
    x0_px: float
    y0_px: float
    omega_rad: float
    phi_rad: float
    kappa_rad: float
    X0_mm: float
    Y0_mm: float
    Z0_mm: float
    b: list[float]
    polynomial: Literal["distortion", "correction"] = Field(
        "distortion",
        description="What b1 to b9 give: the distortion, added to the ideal point, or the correction, added "
        "to the observed point.",
    )
    local_field: LocalFieldDocument | None = None


class CalibrationDocument(Document):
    """A calibration as it is stored and exported."""

    # Under an alias: a field `schema` would shadow a method of every model.
    schema_: Literal["grabberd/calibration/1"] = Field(alias="schema")
    id: str
    created_utc: str
    source: str = Field(description="Its origin, for people.")
    image: ImageSize
    views: dict[str, CalibratedView] = Field(description="The views `left` and `right`.")
    covariance: list[list[float]] | None = Field(
        None, description="Covariance of the left, then the right view's 18 parameters; null if not known."
    )
    sigma0_px: float | None = Field(None, description="Standard deviation of unit weight.")
    glass: Glass | None = Field(None, description="The glass plate in front of the object, if there was one.")
    details: JsonObject | None = Field(None, description="Certificate, temperature, settings, tests, …")
