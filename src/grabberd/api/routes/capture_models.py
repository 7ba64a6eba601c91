"""Captures as they go in and out over HTTP."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.acquisition import Outcome
from grabberd.api.docs.examples import CAPTURE as EXAMPLE
from grabberd.api.docs.examples import POINTS as POINTS_EXAMPLE
from grabberd.api.routes.models import Document, Next, shown
from grabberd.api.routes.named_types import (
    Bits,
    CaptureState,
    InterruptionPolicy,
    JsonObject,
    LabelChanges,
    Labels,
    LinesKind,
    OverrunPolicy,
    Verdict,
)


class CaptureWish(Document):
    """What is asked of a capture: so many fields, so many seconds, or until it is stopped."""

    armed: bool = Field(False, description="It waits for its trigger: POST captures/{capture_id}/trigger.")
    fields: int | None = Field(
        None, ge=1, le=10_000_000, description="Length in fields of 20 ms, lost ones included."
    )
    duration_s: float | None = Field(None, gt=0, le=200_000, description="Length in seconds.")
    bits: Bits | None = Field(None, description="Bits a pixel; default: as configured.")
    lines: LinesKind | None = Field(
        None, description="'doubled' (default at 1 bit) or 'field' (default for grey)."
    )
    pre_trigger_fields: int = Field(
        0,
        ge=0,
        le=4096,
        description="Fields before the request, or before the trigger of an armed one, that belong to it: "
        "as many as the ring has, at most its slots.",
    )
    post_trigger_fields: int | None = Field(
        None,
        ge=1,
        le=10_000_000,
        description="Of an armed one: fields from the trigger on; default: until stopped.",
    )
    overrun: OverrunPolicy = Field(
        "count",
        description="Fields that the ring loses because the computer is too busy: count them, or stop there.",
    )
    on_interruption: InterruptionPolicy | None = Field(
        None,
        description="When the device fails to deliver: 'continue' with the gap in the ledger, or 'end'; "
        "default: as configured.",
    )
    note: Annotated[str, StringConstraints(max_length=2000)] = ""
    labels: Labels = Field(default_factory=dict, description="Cow, teat, liner, …")

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if self.armed and (self.fields is not None or self.duration_s is not None):
            raise ValueError("an armed capture takes post_trigger_fields in place of fields or duration_s")
        if not self.armed and self.post_trigger_fields is not None:
            raise ValueError("post_trigger_fields are for an armed capture")
        if self.fields is not None and self.duration_s is not None:
            raise ValueError("give fields or duration_s, not both")
        if self.fields is not None and self.pre_trigger_fields >= self.fields:
            raise ValueError("pre_trigger_fields are among the fields, so there have to be fewer of them")
        return self


class CaptureOrder(CaptureWish):
    """A capture as it is asked for: so many fields, so many seconds, or until it is stopped."""

    model_config = shown(
        {"fields": 64, "labels": {"cow": "112", "teat": "front left"}, "note": "new liners"},
        {"armed": True, "pre_trigger_fields": 25, "post_trigger_fields": 500, "bits": 8},
    )

    device: str | None = Field(None, description="Name of the device; not needed where there is one.")


class CapturePatch(Document):
    """What changes of what is said of a capture; what is left out stays."""

    model_config = shown({"pinned": True, "labels": {"cow": "113", "teat": None}})

    note: Annotated[str, StringConstraints(max_length=2000)] | None = None
    pinned: bool | None = Field(None, description="A pinned capture is not deleted, by nobody.")
    labels: LabelChanges | None = Field(None, description="Added to those it has; null takes one away.")


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


class GroupDocument(Document):
    """The group of a capture that was made together with others."""

    id: str
    devices: list[str]
    start_utc: str | None = Field(description="When all of them began; None while they are armed.")
    start_ns: int | None = Field(description="The same moment by the computer's monotonic clock.")


class CaptureDocument(Document):
    """A capture."""

    model_config = shown(EXAMPLE)

    id: str
    device: str
    state: CaptureState = Field(
        description="'armed': it waits for its trigger; 'unsealed': the disk was too full to close it; it is "
        "sealed at the next start; 'disarmed': only as the answer to the stop of an armed one, of which "
        "nothing is left."
    )
    verdict: Verdict | None = Field(description="None while it is recording.")
    ended_because: str | None
    created_utc: str = Field(description="When it began; of an armed one, since when it waits.")
    trigger_utc: str | None = Field(description="When it was asked for, or triggered; None of older ones.")
    pre_trigger_fields: int = Field(description="So many fields of it lie before that moment.")
    group: GroupDocument | None = Field(None, description="None of a capture that was made alone.")
    first_field_s: float | None = Field(
        None,
        description="From its start (`created_utc`), the same for all of a group, to its first field: a "
        "point's `time_s` and this are its time on the group's axis. None before there is a field.",
    )
    bits: int
    lines: str
    fields: int = Field(description="Fields that are in it.")
    ledger: LedgerDocument
    runs: list[RunDocument]
    labels: dict[str, str]
    note: str
    pinned: bool
    size_bytes: int
    rig: JsonObject | None = Field(
        None,
        description="What its points say of camera and mirrors: the worst verdict (fits, doubtful, moved, "
        "unmatched), and the means of shift_px and ratio; null where they say nothing.",
    )


class CaptureList(Document):
    """A page of captures, newest first."""

    captures: list[CaptureDocument]
    next: str | None = Next


class MadeWith(Document):
    """What points were made with; null where it is not known."""

    calibration: JsonObject | None
    object: JsonObject | None
    settings: JsonObject | None


class WholeRunDocument(RunDocument):
    """A run with the documents that its points were made with."""

    made_with: MadeWith


class PointColumns(Document):
    """Points of one field: the same target in the same place of every list."""

    target: list[int]
    x_mm: list[float]
    y_mm: list[float]
    z_mm: list[float]
    sigma_x_mm: list[float] = Field(description="From pointing and line jitter.")
    sigma_y_mm: list[float]
    sigma_z_mm: list[float]
    calibration_sigma_x_mm: list[float] = Field(description="From the calibration; common to all fields.")
    calibration_sigma_y_mm: list[float]
    calibration_sigma_z_mm: list[float]
    residual_px: list[float]


class FieldPoints(PointColumns):
    """The points of one field of a capture."""

    n: int
    time_s: float = Field(description="Since the capture's first field.")


class PointsDocument(Document):
    """Points of a run, thinned out."""

    model_config = shown(POINTS_EXAMPLE)

    capture: str
    run: int
    every: int = Field(description="Only fields whose number this divides are here.")
    fields: list[FieldPoints]
