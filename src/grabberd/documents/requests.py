"""Bodies of requests, and the messages of a client of the preview."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.config import ThresholdConfig
from grabberd.documents.document import (
    AllDevices,
    Bits,
    CalibrationFrameTreatment,
    DeviceNames,
    Document,
    Handedness,
    InterruptionPolicy,
    JsonObject,
    LabelChanges,
    Labels,
    LinesKind,
    MarkChanges,
    Note,
    Number,
    OverrunPolicy,
    Turn,
    Weights,
    with_examples,
)
from grabberd.tables import LARGEST_NUMBER

CHECK_S = 10.0
"""Length of a check's capture."""
MOST_FIELDS = 10_000_000
CaptureName = Annotated[str, StringConstraints(pattern=r"^[0-9A-Za-z_-]{1,80}$")]
Parameter = Annotated[str, StringConstraints(pattern=r"^[0-9A-Za-z_.]{1,40}$")]

_DEVICE = "Name of the device; not needed if there is only one."
_FRAME = (
    "Name of a calibration frame that comes with the program, or its document; not needed if there is only "
    "one."
)


class CaptureRequest(Document):
    """Options of a capture, and of each capture of a group."""

    armed: bool = Field(False, description="Wait for a trigger: POST captures/{capture_id}/trigger.")
    fields: int | None = Field(
        None,
        ge=1,
        le=MOST_FIELDS,
        description="Length in fields, or progressive pictures, including lost ones.",
    )
    duration_s: float | None = Field(
        None,
        gt=0,
        le=200_000,
        description="Length in seconds; for an armed capture, counted from the trigger.",
    )
    bits: Bits | None = Field(None, description="Bits per pixel; default: as configured.")
    lines: LinesKind | None = Field(
        None, description="'doubled' (default at 1 bit) or 'field' (default for grey)."
    )
    pre_trigger_fields: int = Field(
        0,
        ge=0,
        le=4096,
        description="Number of fields before the request, or before the trigger of an armed capture, to "
        "include: those that the ring still holds, at most its number of slots.",
    )
    post_trigger_fields: int | None = Field(
        None,
        ge=1,
        le=MOST_FIELDS,
        description="Armed captures only: number of fields from the trigger on; default: until stopped.",
    )
    overrun: OverrunPolicy = Field(
        "count",
        description="What to do about fields that the ring loses because the computer is too busy: count "
        "them, or stop there.",
    )
    on_interruption: InterruptionPolicy | None = Field(
        None,
        description="What to do when the device stops delivering: 'continue' with the gap in the ledger, or "
        "'end'; default: as configured.",
    )
    note: Note = ""
    labels: Labels = Field(default_factory=dict, description="Cow, teat, liner, …")

    def of_rate(self, rate_hz: float) -> Self:
        """The request with its length in `fields`, for an armed capture from the trigger on.

        Args:
            rate_hz: Fields per second of the device.
        """
        fields = self.post_trigger_fields if self.armed else self.fields
        if self.duration_s is not None:
            fields = max(1, round(self.duration_s * rate_hz))
        return self.model_copy(update={"fields": fields})


class CaptureOptions(CaptureRequest):
    """Options of a capture, and of a group of captures, whose length is given in one way."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if self.armed and self.fields is not None:
            raise ValueError("an armed capture takes post_trigger_fields in place of fields")
        if self.post_trigger_fields is not None and self.duration_s is not None:
            raise ValueError("give post_trigger_fields or duration_s, not both")
        if not self.armed and self.post_trigger_fields is not None:
            raise ValueError("post_trigger_fields requires an armed capture")
        if self.fields is not None and self.duration_s is not None:
            raise ValueError("give fields or duration_s, not both")
        if self.fields is not None and self.pre_trigger_fields >= self.fields:
            raise ValueError("pre_trigger_fields are included in fields, so there have to be fewer of them")
        return self


class NewCapture(CaptureOptions):
    """A capture to start or arm: a number of fields, a number of seconds, or until it is stopped."""

    model_config = with_examples(
        {"fields": 64, "labels": {"cow": "112", "teat": "front left"}, "note": "new liners"},
        {"armed": True, "pre_trigger_fields": 25, "post_trigger_fields": 500, "bits": 8},
    )

    device: str | None = Field(None, description=_DEVICE)


class NewCaptureGroup(CaptureOptions):
    """Captures of several devices to start at the same moment, all with the same length and bits."""

    model_config = with_examples(
        {"devices": "all", "duration_s": 60, "labels": {"cow": "112"}},
        {
            "devices": ["left", "right"],
            "armed": True,
            "pre_trigger_fields": 25,
            "labels_of": {"left": {"teat": "front left"}, "right": {"teat": "front right"}},
        },
    )

    devices: AllDevices | DeviceNames = Field("all", description="Names of the devices, or 'all'.")
    labels_of: dict[str, Labels] = Field(
        default_factory=dict, description="Labels of individual devices' captures, in addition to `labels`."
    )

    def of_device(self, name: str) -> Self:
        """The request for the capture of one device: its own labels take precedence."""
        return self.model_copy(update={"labels": {**self.labels, **self.labels_of.get(name, {})}})


class CapturePatch(Document):
    """Changes to a capture's note, labels, marks and pin; whatever is left out stays."""

    model_config = with_examples({"pinned": True, "labels": {"cow": "113", "teat": None}})

    note: Note | None = None
    pinned: bool | None = Field(
        None, description="A pinned capture is never deleted, neither on request nor by retention."
    )
    labels: LabelChanges | None = Field(
        None, description="Labels to add to the present ones; null removes a label."
    )
    marks: MarkChanges | None = Field(
        None,
        description="Names of fields to mark, by their numbers; a name replaces an earlier one, null removes "
        "a mark.",
    )


_TURN = (
    "Turn of the calibration frame in the picture, counter-clockwise, as somebody has seen it: 0 if its X "
    "points down and its Y to the right. Needed only for a frame that looks the same in several ways."
)


class TargetMark(Document):
    """A target of the calibration frame where somebody sees it in the picture."""

    view: Literal["left", "right"]
    target: int = Field(ge=0, description="Its id.")
    x_px: Number = Field(description="Frame pixels; the nearest image is the target's.")
    y_px: Number


MOST_MARKS = 2000
MOST_DROPPED = 1000


class CaptureMark(TargetMark):
    """A target of the calibration frame where somebody sees it in a capture's picture."""

    capture: str | None = Field(None, max_length=80, description="Id of the capture; default: the first.")


class CertifiedLength(Document):
    """A certified distance of two targets of the calibration frame, which the adjustment does not see."""

    between: tuple[int, int] = Field(description="Ids of the two targets.")
    length_mm: float = Field(gt=0, le=LARGEST_NUMBER, allow_inf_nan=False)
    sigma_mm: float = Field(
        0.02, ge=0, le=LARGEST_NUMBER, allow_inf_nan=False, description="Its standard deviation."
    )


class CalibrationOptions(Document):
    """Options of the adjustment; the defaults are those of `grabberd calibrate`."""

    weights: Weights | None = Field(
        None, description="Weight each mean by its own σ (default), or all alike, the paper's option."
    )
    frame: CalibrationFrameTreatment | None = Field(
        None, description="Weight the calibration frame's points by their σ (default), or hold them fixed."
    )
    shared: bool | list[Parameter] | None = Field(
        None, description="Lens parameters that both views share: all, none (default), or these."
    )
    tied: bool | None = Field(None, description="Set b9 = b8, as in the paper's model.")
    free: list[Parameter] | None = Field(
        None, max_length=100, description="Parameters to adjust, e.g. 'b3' or 'left.b3'; default: all."
    )
    alpha: float | None = Field(None, gt=0, lt=1, description="Significance level of the tests.")
    local_field: bool | None = Field(
        None, description="True if a smooth field of residuals may be added to the model."
    )
    handedness: Handedness | None = Field(
        None, description="Handedness of both views; default: as the rig states it, or else determined."
    )
    turn_deg: Turn | None = Field(None, description=_TURN)
    marks: list[CaptureMark] | None = Field(
        None, max_length=MOST_MARKS, description="Targets marked by hand, where the picture leaves it open."
    )
    dropped: list[int] | None = Field(
        None, max_length=MOST_DROPPED, description="Ids of targets to leave out, as if the frame had none."
    )
    check_length: CertifiedLength | None = Field(
        None, description="A certified length; default: the one in the calibration frame's document."
    )


MOST_POSES = 16
"""Poses of the calibration frame in one calibration; its time grows with the cube of their number."""


class CalibrationRequest(Document):
    """A calibration to make from captures of the calibration frame, or a complete one to store."""

    model_config = with_examples(
        {
            "capture": "20260301T093000125Z-barn",
            "calibration_frame": "paper-108",
            "note": "after the lens was cleaned",
        }
    )

    capture: str | None = Field(None, max_length=80, description="Id of a capture of the calibration frame.")
    captures: list[CaptureName] | None = Field(
        None,
        min_length=1,
        max_length=MOST_POSES,
        description="Ids of several, in place of one: one for each pose of the calibration frame before the "
        "same rig. The first defines the coordinates.",
    )
    calibration_frame: str | JsonObject | None = Field(None, description=_FRAME)
    options: CalibrationOptions | None = Field(None, description="Options of the adjustment.")
    document: JsonObject | None = Field(None, description="A complete calibration, in place of a capture.")
    device: str | None = Field(
        None,
        description="Device that the calibration belongs to; default: the capture's. Not needed if there is "
        "only one.",
    )
    note: Note = ""

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if sum(one is not None for one in (self.capture, self.captures, self.document)) != 1:
            raise ValueError("give one of capture, captures and document")
        if len(set(self.captures or ())) != len(self.captures or ()):
            raise ValueError("captures names one of them twice")
        if self.document is not None and (self.options or self.calibration_frame):
            raise ValueError("options and calibration_frame apply to a capture, not to a document")
        return self

    @property
    def poses(self) -> tuple[str, ...]:
        """Ids of the captures, one for each pose of the calibration frame; none for a document."""
        return tuple(self.captures or ([] if self.capture is None else [self.capture]))


class CalibrationChoice(Document):
    """The calibration that a device shall measure with."""

    model_config = with_examples({"id": "20260301T094211003Z"})

    id: str = Field(max_length=200)
    device: str | None = Field(None, description=_DEVICE)
    despite_failure: bool = Field(
        False, description="Use it although its acceptance failed; only an admin may say so."
    )


class MeasurementRequest(Document):
    """Choices for a re-measurement."""

    model_config = with_examples({"include_damaged": True})

    include_damaged: bool = Field(
        False, description="Measure damaged fields too; their points may be wrong in place or time."
    )


class RejectionRequest(Document):
    """Rejection of a calibration, with its reason."""

    model_config = with_examples({"note": "the frame was touched while it was captured"})

    note: Note = ""


class IdentificationRequest(Document):
    """The calibration frame to look for."""

    model_config = with_examples({"calibration_frame": "paper-108"})

    calibration_frame: str | JsonObject | None = Field(
        None, description="Its name or its document; not needed if there is only one."
    )
    turn_deg: Turn | None = Field(None, description=_TURN)
    marks: list[TargetMark] = Field(
        default_factory=list, max_length=MOST_MARKS, description="Targets marked by hand."
    )


class CheckRequest(Document):
    """Options of a check; all of them can be left out."""

    model_config = with_examples({"duration_s": 10, "in_place": True})

    calibration_frame: str | JsonObject | None = Field(None, description=_FRAME)
    in_place: bool = Field(
        False,
        description="True if the calibration frame stands exactly where it stood during calibration; a "
        "camera that has moved as a whole is then detected too.",
    )
    duration_s: float = Field(CHECK_S, ge=0.2, le=60, description="Length of the check's capture in seconds.")


class SettingsRequest(Document):
    """Settings of a device from now on."""

    model_config = with_examples({"threshold": {"kind": "fixed", "value": 96}})

    device: str | None = Field(None, description=_DEVICE)
    threshold: ThresholdConfig | None = Field(description="null: as configured.")


LARGEST_SIDE_PX = 4096


class PreviewPart(Document):
    """A part of the frame, in frame pixels."""

    x: int = Field(ge=0, le=LARGEST_SIDE_PX)
    y: int = Field(ge=0, le=LARGEST_SIDE_PX)
    columns: int = Field(ge=1, le=LARGEST_SIDE_PX)
    lines: int = Field(ge=1, le=LARGEST_SIDE_PX)


class PreviewAsk(Document):
    """The picture that a client wants from now on."""

    picture: Literal["grey", "bits"] = "grey"
    part: PreviewPart | None = None
    width_px: int | None = Field(None, ge=1, le=16384)
    """Pixels that the client's screen has for the width of the frame."""
    rate_hz: float | None = Field(None, ge=0.1, le=200)
    """Pictures a second that it wants at most; null: as many as its link carries."""
    light: bool = False
    """Whether the light of the newest field is sent, too, as text: that of `devices/{name}/light`."""


class PreviewWords(Document):
    """A message of a client."""

    ask: PreviewAsk | None = None
    taken: int = Field(0, ge=0, le=1000)
    """Pictures that it has taken since its last message."""
