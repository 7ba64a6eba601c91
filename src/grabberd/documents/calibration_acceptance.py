"""The acceptance of a calibration: its verdict, the reasons, and what they rest on."""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import Document
from grabberd.documents.named_types import AcceptanceVerdict


class AcceptanceReason(Document):
    """A reason of the verdict."""

    code: str = Field(description="Name of the reason, see docs/reference/acceptance.md.")
    level: Literal["failed", "remark"]
    message: str
    hint: str
    values: dict[str, float | int | str] = Field(description="The values in the message, by name.")


class RigComparison(Document):
    """A property of the rig: nominal, previous and found, with the differences in σ."""

    quantity: str
    view: str = Field(description="Its view; empty for the rig as a whole.")
    unit: str
    nominal: float | None
    previous: float | None = Field(description="Null without a previous calibration.")
    found: float
    sigma: float
    nominal_z: float | None = Field(description="Found minus nominal, in σ of the difference.")
    previous_z: float | None


class CheckLengthResult(Document):
    """The check length, certified and as measured."""

    first: int = Field(description="Id of its first target.")
    second: int
    certified_mm: float
    measured_mm: float
    difference_mm: float
    sigma_mm: float = Field(description="σ of the difference.")


class ResidualPattern(Document):
    """Agreement of neighbouring residuals in one view."""

    view: str
    correlation: float
    statistic: float = Field(description="The correlation in σ of that of noise.")


class PictureMovement(Document):
    """Movement of a view's picture during the capture, in frame pixels."""

    rms_px: float
    drift_px: float


class CalibrationAcceptance(Document):
    """Verdict on a calibration."""

    verdict: AcceptanceVerdict
    reasons: list[AcceptanceReason] = Field(description="The gravest first.")
    rig: list[RigComparison]
    check_length: CheckLengthResult | None
    symmetries: list[str] = Field(
        description="Motions that map most of the calibration frame onto itself, in words."
    )
    patterns: list[ResidualPattern]
    movement: dict[str, PictureMovement] = Field(description="By view.")
