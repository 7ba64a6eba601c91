"""Jobs, work that takes long, and their results: one document for each kind of job."""

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from grabberd.documents.calibration_reports import PixelAxes
from grabberd.documents.captures import CoverageDocument
from grabberd.documents.devices import FieldOrderDocument
from grabberd.documents.document import Document, JobProblem, Next, ViewHandedness, with_examples
from grabberd.documents.enums import JobState
from grabberd.documents.examples import JOB
from grabberd.extension import extensions, in_order, load


class CalibrationResult(Document):
    """Result of a job `calibrate`."""

    calibration: str = Field(description="Id of the new calibration.")


class MeasurementResult(Document):
    """Result of a job `measure`."""

    run: int = Field(description="Number of the new run.")
    fields: int = Field(description="Number of fields measured.")
    points: int = Field(description="Number of points found.")
    field_order: FieldOrderDocument | None = Field(
        None,
        description="What the points tell about the sequence of the fields in time; null for progressive "
        "pictures.",
    )
    warnings: list[str] = Field(default_factory=list, description="Warnings for people, in sentences.")
    coverage: CoverageDocument | None = Field(None, description="How well they were measured.")


class AxesDocument(Document):
    """One length for each axis, and one for all three combined."""

    x_mm: float
    y_mm: float
    z_mm: float
    xyz_mm: float


class Placement(Document):
    """Rigid motion between two poses of the calibration frame."""

    angle_deg: float
    shift_mm: list[float] = Field(description="Along X, Y and Z.")


class CheckResult(Document):
    """Result of a job `check`: the calibration frame as measured, against its certificate."""

    capture: str
    calibration: str = Field(description="Id of the calibration that was checked.")
    calibration_frame: str = Field(description="Name of the calibration frame.")
    in_place: bool
    verdict: Literal["fits", "doubtful", "recalibrate"]
    advice: str = Field(description="What to do about the verdict.")
    reasons: list[str] = Field(description="Reasons for the verdict; empty if the calibration fits.")
    fields: int = Field(description="Number of fields measured.")
    seen: int = Field(description="Number of targets found in both views.")
    of: int = Field(description="Number of targets on the calibration frame.")
    rmse: AxesDocument = Field(
        description="Errors of the points against the certificate, after a rigid fit unless in place."
    )
    chi2: float = Field(
        description="Mean squared error in units of σ; 1 if the calibration is as good as its covariance."
    )
    parallax_px: float = Field(
        description="Root mean square disagreement of the views across the epipolar lines."
    )
    shift_px: dict[str, PixelAxes] = Field(
        description="Mean of observed minus expected images, by view, in frame pixels."
    )
    residual_px: dict[str, PixelAxes] = Field(description="Root mean square of the same.")
    as_placed: AxesDocument = Field(description="Errors without the rigid fit.")
    placed: Placement = Field(
        description="Pose of the calibration frame relative to its pose at calibration."
    )


class ImagePosition(Document):
    """Position of an image, in frame pixels."""

    x_px: float
    y_px: float


class IdentifiedTarget(ImagePosition):
    """Image of a target."""

    target: int


class IdentifiedView(Document):
    """Targets of the calibration frame in one view."""

    found: list[IdentifiedTarget] = Field(description="Sorted by target.")
    missing: list[int] = Field(description="Targets that were not found.")
    other: list[ImagePosition] = Field(description="Images that are no target.")


class ShownField(Document):
    """A field to show targets on: its row k is frame line y0 + k · y_step."""

    field: int = Field(description="Number of the field.")
    y0: int
    y_step: int


class SoughtTarget(Document):
    """Target that somebody has to find in the picture."""

    target: int = Field(description="Id of the target.")
    x_mm: float = Field(description="Its place on the calibration frame, likewise below.")
    y_mm: float
    places: list[ImagePosition] = Field(description="Its possible places in the left view.")


class IdentificationResult(Document):
    """Result of a job `identify`: the calibration frame's targets that a capture shows."""

    capture: str
    calibration_frame: str = Field(description="Name of the calibration frame.")
    of: int = Field(description="Number of targets on the calibration frame.")
    picture: ShownField
    views: dict[str, IdentifiedView]
    moved: bool = Field(description="True if the calibration frame did not stand still.")
    turn_deg: float | None = Field(
        None,
        description="Turn of the calibration frame in the left view, counter-clockwise; null if unknown.",
    )
    handedness: ViewHandedness | None = Field(None, description="Of each view, as the picture shows it.")
    mirrored: bool = Field(
        False, description="True if a view is seen mirrored, or the views swapped, unlike the configured rig."
    )
    asks: list[SoughtTarget] = Field(
        default_factory=list,
        description="Targets to mark in the left view, where the picture leaves it open.",
    )
    problem: JobProblem | None = Field(description="Why it is unclear which target is which.")


_OWN = (CheckResult, IdentificationResult, MeasurementResult, CalibrationResult)
if TYPE_CHECKING:
    JobResult = Document
else:
    _ALL = in_order(
        [(one.__name__, one) for one in _OWN], [one for found in extensions() for one in found.results]
    )
    JobResult = reduce(or_, (load(one) if isinstance(one, str) else one for one in _ALL.values()))


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
