"""Devices: state and health, what they measure, how their picture is illuminated, and their field order.

Field order is by the measured points: it says whether fields follow one another in time as they are
numbered.

Health is one verdict, made in the daemon, that page, broker and /readyz go by.
"""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.core.geometry.document_reader import finite
from grabberd.core.ledger import LossCause, Outcome, Rebase
from grabberd.core.reconstruction.drift_check import MarkState, RigVerdict
from grabberd.core.reconstruction.field_order import FieldOrderFit, Order
from grabberd.documents.calibrations import ActiveCalibration
from grabberd.documents.document import LINES, Document, JsonObject, Latency, ViewCounts, extended
from grabberd.documents.enums import DeviceState, Rung
from grabberd.errors import Cause


class FaultDocument(Document):
    """A fault of the daemon itself, its captures' folder or its settings."""

    cause_code: Cause = Field(description="Machine-readable code.")
    level: Literal["fault", "warning"] = Field(
        description="fault: a person has to act; warning: to be known, or repaired by itself."
    )
    message: str
    hint: str
    since_utc: str


HealthLevel = TypeAliasType("HealthLevel", Literal["good", "unknown", "warning", "bad"])
HealthPart = TypeAliasType(
    "HealthPart",
    Literal[
        "device",
        "signal",
        "rate",
        "lost",
        "ring",
        "computer",
        "measurement",
        "calibration",
        "rig",
        "order",
        "disk",
        "records",
        "clock",
    ],
)
StartAdvice = TypeAliasType("StartAdvice", Literal["allowed", "doubtful", "refused"])


class HealthPartDocument(Document):
    """One part of the instrument."""

    level: HealthLevel
    word: str = Field(description="Machine-readable word for what it is like, such as `off` or `moved`.")
    message: str = Field("", description="What is wrong, with values; empty if nothing is.")
    hint: str = Field("", description="What to do about it.")
    cause_code: Cause | None = Field(None, description="Machine-readable code of the cause, if it has one.")
    since_utc: str | None = Field(None, description="Since when, if that is known.")


class DeviceHealth(Document):
    """Health of a device and of what it needs: the computer, the disk, the daemon's records."""

    level: HealthLevel = Field(description="The worst of its parts; what is unknown does not count.")
    part: HealthPart | None = Field(description="The part that is worst, the first if several are.")
    message: str = Field(description="What is wrong with that part; empty if nothing is.")
    hint: str = Field(description="What to do about it.")
    start: StartAdvice = Field(
        description="Whether a capture may be started: `doubtful` if it would be of little use now, "
        "`refused` if there would be none."
    )
    parts: dict[HealthPart, HealthPartDocument] = Field(
        description="Every part, but `order` where a device gives progressive pictures."
    )


_WRONG = {
    Order.REVERSED: (
        "the two fields of each frame change places in time",
        "run 'grabberd devices --check-field-order', set the option that it names, and record again",
    ),
    Order.SAME_INSTANT: (
        "both fields of a frame show the same instant",
        "this grabber delivers one moment a frame, not two: use another one; 'grabberd devices' rates them",
    ),
}


class FieldOrderDocument(Document):
    """Order of the fields in time, as the points of moving targets show it."""

    order: Order = Field(
        description="'same_instant': both fields of a frame were exposed at once; 'no_movement', 'unclear': "
        "the points tell nothing, or not yet."
    )
    shift_fields: float | None = Field(
        description="Time by which each second field is displaced against its number, in fields: 0 in the "
        "right order, 0.5 for fields of one instant, 1 in reversed order."
    )
    sigma_fields: float | None
    zigzag_mm: float | None = Field(
        description="Root mean square distance, over the moving targets, between the points of a field and "
        "the path through the fields around it that this causes."
    )
    fields: int = Field(description="Number of fields with movement that it was determined from.")

    @classmethod
    def of(cls, fit: FieldOrderFit) -> "FieldOrderDocument":
        """The document of a fit; unknown values are None."""
        known = {name: finite(getattr(fit, name)) for name in ("shift_fields", "sigma_fields", "zigzag_mm")}
        return cls(order=fit.order, fields=fit.fields, **known)

    @property
    def problem(self) -> tuple[str, str] | None:
        """Problem and remedy; None where nothing is known to be wrong."""
        if self.order not in _WRONG:
            return None
        wrong, remedy = _WRONG[self.order]
        size = (
            "" if self.zigzag_mm is None else f": points of moving targets zigzag by {self.zigzag_mm:.2f} mm"
        )
        return f"{wrong}{size}", remedy

    @property
    def warning(self) -> str | None:
        """Problem and remedy in a sentence; None where nothing is known to be wrong."""
        return "; ".join(self.problem) if self.problem else None


class RingDocument(Document):
    """The ring of a device."""

    slots: int
    bits: int
    lines: str | None = Field(description=LINES)
    threshold: int
    waiting: int = Field(description="Slots that its slowest reader has not read yet.")
    deepest: int = Field(description="Largest number of waiting slots since this ring was configured.")


class ViewColumnsDocument(Document):
    """The columns of the picture that belong to a view."""

    first_column: int
    end_column: int


class DeviceLackDocument(Document):
    """A reason why a device cannot measure."""

    lacks: HealthPart
    message: str
    hint: str
    cause_code: Cause | None = Field(description="Machine-readable code of the cause.")


class LackDocument(DeviceLackDocument):
    """A reason why a device cannot measure, with the device's name."""

    device: str


class WidthDocument(Document):
    """Distance between two targets."""

    targets: tuple[int, int]
    width_mm: float | None = Field(description="Null if either target has no point.")
    sigma_mm: float | None = Field(description="Standard deviation from pointing and line jitter.")


class LiveDocument(Document):
    """The newest measured field."""

    n: int
    blobs: int
    views: ViewCounts | None = Field(description="Number of complete targets in each view.")
    points: int
    residual_px: float | None
    widths: list[WidthDocument] = Field(
        description="Distances between targets that face each other in the middle row, the outermost first."
    )
    latency_ms: Latency | None


class MarksDocument(Document):
    """Marks on the cup as one view shows them now."""

    state: MarkState
    marks: int = Field(description="Number of marks used.")
    size_px: float = Field(
        description="Root mean square over the view of the movement that is taken off its images; 0 if "
        "none is."
    )
    sigma_px: float = Field(description="Root mean square of its standard deviation.")


ViewMarks = TypeAliasType("ViewMarks", dict[str, MarksDocument])


class RigDocument(Document):
    """Agreement of camera and mirrors with the calibration, from the fields of the last seconds."""

    verdict: RigVerdict
    shift_px: float | None = Field(
        description="Displacement of the views relative to each other, across the epipolar lines, "
        "once what the marks show has been taken off. Without marks, a displacement along these lines, or of "
        "both views alike, shows only in a check with the calibration frame."
    )
    sigma_px: float | None = Field(
        description="Expected size of the displacement on a rig that has not moved."
    )
    ratio: float | None = Field(description="Root mean square in units of σ; 1 on a rig that has not moved.")
    residual_px: dict[str, dict[str, float | None]] = Field(
        description="Root mean square of the image residuals, by view and axis."
    )
    marks: ViewMarks | None = Field(
        None, description="By view; null for a calibration that has learnt no marks."
    )
    targets: int
    fields: int


class LastMinute(Document):
    """Fields of the last minute."""

    due: int = Field(description="Fields that should have come.")
    lost: int = Field(description="Those of them that did not come whole: lost, damaged or overrun.")


class ComputerDocument(Document):
    """The computer, as far as it lets the program take fields in time."""

    cause: str | None = Field(
        description="Why it took none for so long that the driver's buffers were full; null unless that was "
        "within the last minute."
    )
    hint: str | None
    cause_code: Cause | None
    since_utc: str | None = Field(description="Time at which that ended.")
    standstills: dict[Cause, int] = Field(description="How often, since the daemon started.")
    standstill_s: dict[Cause, float] = Field(description="For how long together.")


@extended
class DeviceDocument(Document):
    """Present state of a device."""

    name: str
    state: DeviceState
    since_utc: str
    cause: str | None
    hint: str | None = Field(description="What to do about the cause.")
    cause_code: Cause | None = Field(
        description="Machine-readable code of the cause, the same for every driver."
    )
    driver: str
    stream: JsonObject | None
    signal: str
    rate_hz: float | None = Field(
        description="Fields per second, or progressive pictures; null while none arrive."
    )
    fields: dict[Outcome, int]
    losses: dict[LossCause, int] = Field(
        description="Fields since the daemon started that were not received, by where to look for the cause."
    )
    last_minute: LastMinute
    rebases: dict[Rebase, int] = Field(
        description="Changes of what the numbers and times of fields go by, since the daemon started."
    )
    computer: ComputerDocument
    openings: int
    recoveries: dict[Rung, int] = Field(
        description="Number of times each recovery step was taken since the daemon started."
    )
    last_failure: str | None = Field(description="Reason for the latest recovery step.")
    last_failure_utc: str | None = Field(description="Time since when that has been the reason.")
    ring: RingDocument
    views: dict[str, ViewColumnsDocument]
    calibration: ActiveCalibration | None
    lacks: list[DeviceLackDocument] = Field(
        description="What keeps the device from measuring as it should, as /readyz reports it."
    )
    health: DeviceHealth
    warnings: list[str] = Field(description="Warnings for people, in sentences.")
    capture_id: str | None = Field(description="The capture that is being recorded.")
    armed_capture_id: str | None = Field(description="The capture that is waiting for its trigger.")
    sealing_capture_id: str | None = Field(
        None,
        description="The capture that is over, but still measured and stored; no other can start meanwhile.",
    )
    group_id: str | None = Field(description="The group of that capture.")
    rig: RigDocument | None = Field(description="Null before the first second of measuring.")
    field_order: FieldOrderDocument | None = Field(
        description="Sequence of the fields in time, by the latest movement; null before the first seconds, "
        "and for progressive pictures."
    )
    live: LiveDocument | None = Field(description="Null unless a field of the last seconds was measured.")


class DeviceList(Document):
    """The devices of the configuration, in its sequence."""

    devices: list[DeviceDocument]


class ObjectDocument(Document):
    """An object model; every list has the targets in the same sequence."""

    name: str
    target_diameter_mm: float
    sigma_mm: float = Field(description="Standard deviation of the nominal coordinates.")
    target: list[int]
    x_mm: list[float]
    y_mm: list[float]
    z_mm: list[float]
    row: list[int]
    column: list[int]


class ObjectTarget(Document):
    """A target's nominal position and its place in the grid."""

    id: int
    x_mm: float
    y_mm: float
    z_mm: float
    row: int
    column: int
    sigma_mm: float | None = Field(
        None, description="Standard deviation of its nominal coordinates, where it is not that of all."
    )


class ObjectModelDocument(Document):
    """An object model as its file and a capture hold it."""

    name: str
    target_diameter_mm: float
    sigma_mm: float = Field(description="Standard deviation of the nominal coordinates.")
    homologous: bool = Field(True, description="True if the targets keep their ids through a capture.")
    normal: tuple[float, float, float] | None = Field(
        None, description="Direction in which all discs face, where it is not that of their grid's surface."
    )
    targets: list[ObjectTarget]


class ViewLightDocument(Document):
    """Illumination of one view."""

    histogram: list[int] = Field(description="Number of pixels of each grey value, 0 to 255.")
    targets: int = Field(description="Number of complete targets at the threshold.")
    diameter_px: float | None = Field(description="Mean diameter of the targets, in frame pixels.")
    background: int = Field(description="Median grey value of the pixels outside the targets.")
    brightest: int = Field(description="Grey value that one pixel in a thousand exceeds.")
    clipped: float = Field(description="Fraction of the targets' pixels at the camera's white level.")
    sharpness: float | None = Field(
        description="Sharpness of the targets' edges along the lines, whatever their brightness: 1 where "
        "only the pixels blur them; null if too few targets can be judged."
    )


class LightDocument(Document):
    """Illumination of the newest field, view by view."""

    threshold: int
    views: dict[str, ViewLightDocument]


class ReadyDocument(Document):
    """Every device measures as it should."""

    status: Literal["ready"] = "ready"
    faults: list[FaultDocument] = Field(description="What is wrong with the daemon itself.")
