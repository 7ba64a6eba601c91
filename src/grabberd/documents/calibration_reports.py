"""The report of a calibration: everything that the calibration rests on, and its acceptance.

The acceptance has a verdict, the reasons, and what they rest on.
"""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import AcceptanceVerdict, Document, Glass, ImageSize, ViewHandedness, Weights


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
    drift_sigma_px: float | None = Field(None, description="Of the drift; null if unknown.")


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


Axis = Literal["x", "y", "z"]
Grid = list[list[float | None]]
"""Rows of numbers; null where a view does not reach."""


class CapturedFrame(Document):
    """The capture that a calibration was made from."""

    id: str
    device: str | None
    started_utc: str
    fields: int
    bits: int
    lines: str


class ReportedFrame(Document):
    """The calibration frame and its certificate."""

    name: str
    targets: int
    sigma_mm: float
    target_diameter_mm: float
    certificate: object = Field(description="As the calibration frame's document has it.")
    temperature_C: object = Field(  # noqa: N815 - the key that users write
        description="As the calibration frame's document has it."
    )


class AdjustmentSettings(Document):
    """The settings of the adjustment."""

    weights: Weights
    frame: Literal["weighted", "held"]
    free: list[str]
    shared: list[str]
    tied: bool
    alpha: float | None = Field(
        description="Significance level of the parameter tests; null: every parameter was kept."
    )
    local_field: bool
    handedness: int | None
    method: str = Field(description="Locator of the targets.")


class FrameIdentification(Document):
    """Identification of the calibration frame's targets, by view."""

    handedness: ViewHandedness
    turn_deg: float | None = Field(
        None, description="Turn of the calibration frame in the left view, counter-clockwise."
    )
    rms_px: dict[str, float | None]
    runner_up_rms_px: dict[str, float | None] = Field(description="The same of the second best assignment.")
    runner_up_found: dict[str, int] = Field(description="Number of targets that it explains.")
    margin: dict[str, float | None] = Field(
        description="By how much −2 ln(likelihood) of the second best is worse; null if there is none."
    )
    found: dict[str, int]
    of: int = Field(description="Number of targets on the calibration frame.")
    unmatched_blobs: dict[str, int]
    description: dict[str, str]


class PixelAxes(Document):
    """A length in the picture along each axis, in frame pixels."""

    x: float
    y: float


class PoseRow(Document):
    """A pose of the calibration frame, in the coordinates of its first."""

    capture: str | None = Field(None, description="Id of the capture that shows it.")
    turn_deg: float = Field(description="Angle of the rotation from the first pose.")
    x_mm: float
    y_mm: float
    z_mm: float
    sigma_x_mm: float
    sigma_y_mm: float
    sigma_z_mm: float
    image_points: int
    tau: float = Field(
        description="Root mean square of its standardised residuals: 1 where it agrees with the other poses."
    )


class AdjustmentResult(Document):
    """Result of the adjustment as a whole."""

    sigma0: float = Field(description="Standard deviation of unit weight.")
    sigma0_px: float
    freedom: int
    steps: int
    image_points: int
    targets: int
    rms_px: dict[str, PixelAxes] = Field(description="Root mean square of the residuals, by view.")
    unmodelled_px: float = Field(description="σ of what no parameter describes.")
    poses: list[PoseRow] = Field(
        default_factory=list, description="Poses of the calibration frame after the first."
    )


class ParameterRow(Document):
    """A parameter of the functional model; σ is null if it was not adjusted."""

    name: str
    unit: str
    value: float
    sigma: float | None
    state: Literal["adjusted", "held", "dropped"]
    unknown: str | None = Field(description="Name of its unknown, which both views may share.")


class ReportedView(Document):
    """Parameters of one view."""

    name: str
    handedness: int
    first_column: int
    end_column: int
    parameters: list[ParameterRow]


class Unknowns(Document):
    """The unknowns of the adjustment and the correlations between them."""

    names: list[str]
    correlation: Grid


class ParameterComparison(Document):
    """A parameter of the left view compared with that of the right one."""

    parameter: str
    unit: str
    left: float
    right: float
    difference: float
    sigma: float | None
    statistic: float | None
    p: float | None


class SignificanceTest(Document):
    """F test of the hypothesis that parameters are zero."""

    parameters: list[str]
    round: int
    kind: str
    statistic: float
    q: int
    freedom: int
    p: float
    effect_px: float = Field(description="Greatest shift of a target's image by them.")
    dropped: bool


class ResidualRow(Document):
    """A target's image in one view: position, residual, σ, redundancy and standardised residual."""

    view: str
    target: int
    fields: int
    x_px: float | None
    y_px: float | None
    dx_px: float | None
    dy_px: float | None
    sigma_x_px: float | None
    sigma_y_px: float | None
    redundancy_x: float | None
    redundancy_y: float | None
    tau_x: float | None
    tau_y: float | None


class BlunderRow(Document):
    """An image that was left out, by its worse coordinate."""

    view: str
    target: int
    x_px: float | None
    y_px: float | None
    axis: Literal["x", "y"]
    residual_px: float
    tau: float
    critical: float


class NormalityTest(Document):
    """Test of the residuals' normality."""

    view: str
    count: int
    skewness: float | None
    excess_kurtosis: float | None
    test: str
    statistic: float | None
    p: float | None


class AxesMm(Document):
    """A length for each axis and for all three combined, in mm."""

    x: float
    y: float
    z: float
    xyz: float


class HeldOutPoint(Document):
    """A target that was measured without having taken part: position, error and σ."""

    target: int
    block: int
    x_mm: float | None
    y_mm: float | None
    z_mm: float | None
    dx_mm: float | None
    dy_mm: float | None
    dz_mm: float | None
    sigma_x_mm: float | None
    sigma_y_mm: float | None
    sigma_z_mm: float | None


class Validation(Document):
    """Cross-validation with held-out targets, block by block."""

    blocks: int
    rmse_mm: AxesMm
    predicted_mm: AxesMm
    chi2: float
    freedom: int
    p: float
    points: list[HeldOutPoint]


class VolumePlane(Document):
    """Expected σ over a plane of the volume: from the calibration alone, and in total."""

    z_mm: float
    calibration: dict[Axis, Grid]
    total: dict[Axis, Grid]


class Volume(Document):
    """Expected σ of X, Y and Z over the volume, plane by plane."""

    x_mm: list[float]
    y_mm: list[float]
    planes: list[VolumePlane]
    pointing_px: list[float]


class ShiftGrid(Document):
    """A displacement over a view's half of the picture, in frame pixels."""

    view: str
    columns: list[float]
    lines: list[float]
    dx_px: Grid
    dy_px: Grid


class LocalFieldTrial(Document):
    """Trial of a local field in each view, and whether it was accepted."""

    accepted: bool
    held_out_rms_px: dict[str, dict[Literal["without", "with"], float]] = Field(
        description="Root mean square of the residuals of held-out targets without and with it, by view."
    )
    gain: float | None
    evidence: float | None = Field(
        default=None, description="Log likelihood of the field over that of errors without any pattern."
    )
    length_px: dict[str, float | None] = Field(description="Length of correlation, by view.")
    signal_px: dict[str, float | None] = Field(description="σ of the field, by view.")
    grids: list[ShiftGrid]


class VirtualCamera(Document):
    """A virtual camera with the rays of its half's corners, as unit vectors."""

    name: str
    center_mm: list[float]
    axis: list[float]
    corners: list[list[float]]


class ImagingGeometry(Document):
    """The virtual cameras and the targets in the object's frame."""

    cameras: list[VirtualCamera]
    targets_mm: list[list[float]]
    base_mm: float
    distance_mm: float
    convergence_deg: float
    planar_motion_mm: float | None = Field(
        description="The base along the axis of the relative rotation: zero where each view has one mirror."
    )


class ViewValidity(Document):
    """σ over a view's half of the picture, for points on the plane in the middle of the volume."""

    view: str
    columns: list[float]
    lines: list[float]
    z_mm: float
    projection_px: dict[Literal["x", "y"], Grid] = Field(
        description="σ of where the view shows a fixed point, from the calibration alone."
    )
    point_mm: dict[Axis, Grid] = Field(description="Expected σ of a point of one field, in total.")
    inside: list[list[bool]] = Field(
        description="True in the calibration frame's volume; elsewhere σ is extrapolated."
    )


class DepthValidity(Document):
    """σ over planes of equal Z: root mean square over the volume's width and height."""

    z_mm: list[float]
    inside: list[bool] = Field(description="True in the calibration frame's volume.")
    calibration: dict[Axis, list[float | None]]
    total: dict[Axis, list[float | None]]


class ViewMovement(Document):
    """Cost of a view's movement after the calibration."""

    view: str
    movement: Literal["shift_x", "shift_y", "turn_x", "turn_y", "turn_z"] = Field(
        description="A shift of the picture, or a turn of the camera about its own axis."
    )
    amount: float
    unit: Literal["px", "deg"]
    middle_mm: dict[Axis, float | None] = Field(description="Error in the middle of the volume.")
    corner_mm: dict[Axis, float | None] = Field(description="The greatest one in its corners.")


class CalibrationValidity(Document):
    """Validity of a calibration; null where not both views see the place."""

    volume_mm: dict[Axis, list[float]] = Field(description="From and to, of the calibration frame's targets.")
    pointing_px: list[float] = Field(description="Pointing σ of one field in x and y, as in the totals.")
    views: list[ViewValidity]
    depths: DepthValidity
    movements: list[ViewMovement]


class CalibrationReport(Document):
    """Report of a calibration that was made from a capture; the page for people is drawn from it."""

    schema_: Literal["grabberd/calibration-report/1"] = Field(alias="schema")
    id: str
    created_utc: str
    version: str | None
    note: str | None
    capture: CapturedFrame | None
    calibration_frame: ReportedFrame
    image: ImageSize
    glass: Glass | None
    settings: AdjustmentSettings
    identification: FrameIdentification
    result: AdjustmentResult
    views: list[ReportedView]
    unknowns: Unknowns
    comparison: list[ParameterComparison]
    tests: list[SignificanceTest]
    dropped: list[str] = Field(description="Parameters dropped because they are not significant.")
    residuals: list[ResidualRow]
    blunders: list[BlunderRow]
    normality: list[NormalityTest]
    validation: Validation | None
    volume: Volume
    validity: CalibrationValidity | None = Field(
        default=None, description="Null in reports of earlier versions."
    )
    distortion: list[ShiftGrid]
    local_field: LocalFieldTrial | None = Field(description="Null if none was requested.")
    geometry: ImagingGeometry
    acceptance: CalibrationAcceptance
