"""Captures, their ledgers, runs and coverage, groups of captures, and pages of the library with facets."""

from typing import Annotated, Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.core.ledger import LossCause, Outcome, Rebase
from grabberd.core.reconstruction.coverage import CoverageVerdict, FindingCode
from grabberd.core.reconstruction.drift_check import MarkState
from grabberd.documents.calibrations import CalibrationDocument
from grabberd.documents.channels import ChannelsSummary
from grabberd.documents.devices import FieldOrderDocument, ObjectModelDocument
from grabberd.documents.document import (
    LINES,
    CaptureState,
    DescribedBy,
    Document,
    JsonObject,
    LabelChanges,
    Next,
    Verdict,
    extended,
    with_examples,
)
from grabberd.documents.examples import CAPTURE, GROUP
from grabberd.documents.requests import CaptureName

MissReason = TypeAliasType(
    "MissReason",
    Literal[
        "no_blob_left",
        "no_blob_right",
        "no_blob",
        "rays_apart",
        "off_place",
        "unconfirmed",
        "not_identified",
        "cut_off",
        "unpredicted",
        "taken",
    ],
)
UnexpectedReason = TypeAliasType(
    "UnexpectedReason", Literal["crowded", "turned_away", "hidden", "merged", "outside"]
)


class FindingDocument(Document):
    """Statement about how well a run was measured, with the numbers that it rests on."""

    verdict: CoverageVerdict = Field(description="Verdict that it alone would lead to.")
    code: FindingCode
    values: dict[str, float | None] = Field(description="The numbers that it rests on; shares from 0 to 1.")
    miss: MissReason | None = Field(description="Most frequent reason why targets were not found.")
    in_words: str


class CoverageSummary(Document):
    """Coverage of a run in short: how well it was measured."""

    verdict: CoverageVerdict
    in_words: str = Field(description="The gravest finding as a sentence.")
    findings: list[FindingDocument] = Field(description="The gravest first; never empty.")
    share: float | None = Field(
        description="Share found of all targets that both views should have seen, over all fields, 0 to 1; "
        "null if there were none."
    )
    fields: int = Field(description="Number of fields measured.")
    missing_fields: int = Field(
        description="Number of fields that should have come and could not be measured: lost, damaged, "
        "without a signal."
    )
    residual_px: float | None = Field(
        description="Root mean square of all image residuals after intersection, frame pixels; null without "
        "points."
    )
    residual_sigma: float | None = Field(
        description="The same in units of its expected standard deviation: about 1 or below if the rays meet "
        "as well as the blobs were located."
    )


class TargetCoverage(Document):
    """A target in a run."""

    target: int
    expected: int = Field(description="Number of fields in which both views should have seen it.")
    found: int = Field(description="Number of those in which it was found.")
    misses: dict[MissReason, int] = Field(description="The others, by the reason.")
    unexpected: dict[UnexpectedReason, int] = Field(
        default_factory=dict,
        description="Number of fields in which a view could not show it, by the reason; empty in runs of "
        "earlier versions.",
    )
    reason: MissReason | None = Field(description="The most frequent one; null if it never was missed.")
    in_words: str = Field(description="The same as a sentence; empty if it never was missed.")
    offset_x_mm: float | None = Field(
        description="Mean offset from where its neighbours put it, along X; found ones included. Null if it "
        "was not seen."
    )
    offset_y_mm: float | None
    offset_z_mm: float | None
    offset_sigma_mm: float | None = Field(
        description="Standard deviation of the mean offset, in space; null below two fields."
    )
    offset_fields: int = Field(description="Number of fields that the offset is from: a few a second.")


class FieldCoverage(Document):
    """A field in which targets were missed."""

    n: int
    expected: int
    found: int
    residual_px: float | None


class ViewCorrection(Document):
    """Marks of a view in a run, and the movement that is taken off its images."""

    state: MarkState
    marks: int = Field(description="Number of marks used.")
    shift_px: list[float] | None = Field(
        None,
        description="Shift of the middle of the view since the calibration, in columns and frame lines; null "
        "where nothing is corrected, as for all that follows.",
    )
    shift_sigma_px: list[float] | None = Field(None, description="Its standard deviations.")
    pattern_px: list[float] | None = Field(
        None,
        description="Coefficients of the movement: turn_x, turn_y, rotation, scale, aspect, skew, "
        "keystone_x, keystone_y.",
    )
    pattern_sigma_px: list[float] | None = Field(None, description="Their standard deviations.")
    size_px: float | None = Field(None, description="Root mean square of the movement over the view.")
    sigma_px: float | None = Field(None, description="Root mean square of its standard deviation.")


class CorrectionDocument(Document):
    """Correction of the rig by marks on the cup, from a field on."""

    n: int
    left: ViewCorrection
    right: ViewCorrection


class CoverageDocument(CoverageSummary):
    """Coverage of a run, target by target."""

    targets: list[TargetCoverage]
    worst_fields: list[FieldCoverage] = Field(
        description="The fields in which most targets were missed, at most twenty, in their order."
    )
    corrections: list[CorrectionDocument] = Field(
        default_factory=list,
        description="What was taken off the images since the marks showed that the rig had moved, in order; "
        "each holds until the next. Empty without marks.",
    )
    corrections_not_listed: int = Field(0, description="Number of further ones.")


class LedgerEntryDocument(Document):
    """Consecutive fields that did not arrive intact."""

    first_n: int
    count: int
    outcome: Outcome
    reason: str
    cause: LossCause = Field(
        description="Where to look: the computer (busy, or the program stopped), bus or cable, the camera, "
        "the picture's content, the grabber, or the disk."
    )


class LedgerEventDocument(Document):
    """A change of what the numbers and times of the fields go by, which loses nothing."""

    n: int = Field(description="Number of the first field that goes by the new base.")
    kind: Rebase
    reason: str


MOST_LISTED, MOST_IN_LISTS = 100, 10
"""Entries, events and runs in a capture's document, and in one of many captures."""


class LedgerDocument(Document):
    """Outcome of every field that should have arrived."""

    complete: bool
    in_words: str
    counts: dict[Outcome, int]
    entries: list[LedgerEntryDocument] = Field(
        description="The first hundred, or the first ten where captures are listed; "
        "`captures/{capture_id}/ledger` has all."
    )
    events: list[LedgerEventDocument] = Field(description="As many of the events.")
    entries_not_listed: int = Field(0, description="Number of further entries.")
    events_not_listed: int = Field(0, description="Number of further events.")

    def shortened(self, most: int) -> "LedgerDocument":
        """The same with at most so many entries and events."""
        changes = {
            "entries": self.entries[:most],
            "events": self.events[:most],
            "entries_not_listed": self.entries_not_listed + max(len(self.entries) - most, 0),
            "events_not_listed": self.events_not_listed + max(len(self.events) - most, 0),
        }
        return self.model_copy(update=changes)


class LedgerPage(Document):
    """A page of a capture's ledger: entries and events by their fields."""

    capture: str
    entries: list[LedgerEntryDocument]
    events: list[LedgerEventDocument]
    next: str | None = Next


class RunDocument(Document):
    """Points of a capture and the settings they were measured with."""

    run: int
    kind: str
    created_utc: str
    version: str
    state: str
    coverage: CoverageSummary | None = Field(
        None,
        description="How well it was measured; null while it is being measured, and in files of earlier "
        "versions.",
    )


class MadeWith(Document):
    """Documents that points were measured with; null if unknown."""

    calibration: Annotated[JsonObject, DescribedBy(CalibrationDocument)] | None
    object: Annotated[JsonObject, DescribedBy(ObjectModelDocument)] | None
    settings: JsonObject | None


class WholeRunDocument(RunDocument):
    """A run with the documents that its points were measured with."""

    coverage: CoverageDocument | None = Field(
        None, description="How well it was measured, target by target; null as in `RunDocument`."
    )
    made_with: MadeWith


class MarkDocument(Document):
    """A field that somebody has marked."""

    n: int = Field(description="Number of the field.")
    name: str


class GroupDocument(Document):
    """The group to which a capture belongs."""

    id: str
    devices: list[str]
    start_utc: str | None = Field(description="Common start of all its captures; null while they are armed.")
    start_ns: int | None = Field(
        description="The same moment by the computer's monotonic clock, which also times the fields."
    )


@extended
class CaptureDocument(Document):
    """A capture."""

    model_config = with_examples(CAPTURE)

    id: str
    device: str
    state: CaptureState = Field(
        description="'armed': waiting for its trigger; 'unsealed': the disk was too full to close the file, "
        "which is sealed at the next start; 'disarmed': only in the response to stopping an armed capture, "
        "of which nothing remains."
    )
    verdict: Verdict | None = Field(description="Null while it is recording.")
    ended_because: str | None
    created_utc: str = Field(description="Start of the capture; of an armed one, the time it was armed.")
    trigger_utc: str | None = Field(
        description="Time of the request or the trigger; null in files of earlier versions."
    )
    pre_trigger_fields: int = Field(description="Number of its fields that lie before that moment.")
    group: GroupDocument | None = Field(None, description="Null for a capture that was started alone.")
    first_field_s: float | None = Field(
        None,
        description="Time in seconds from its start (`created_utc`), which all captures of a group share, to "
        "its first field. Add it to a point's `time_s` to get the time on the group's axis. Null before the "
        "first field.",
    )
    bits: int
    lines: str | None = Field(description=LINES)
    rate_hz: float | None = Field(
        None, description="Nominal fields, or progressive pictures, per second; null where it is not known."
    )
    fields: int = Field(
        description="Number of fields in the capture with their pictures, damaged ones and those without a "
        "signal included."
    )
    length_fields: int | None = Field(
        None,
        description="Length that was asked for, in fields, lost ones included, while it is recording; null "
        "for one that lasts until it is stopped, and afterwards.",
    )
    ledger: LedgerDocument
    runs: list[RunDocument] = Field(
        description="The newest hundred, or the newest ten where captures are listed, in order."
    )
    runs_not_listed: int = Field(0, description="Number of earlier ones.")
    coverage: CoverageSummary | None = Field(
        None,
        description="How well the newest run was measured, beside `verdict`, which is about the fields "
        "alone; null while it records, where nothing was to be measured (no calibration or object model), "
        "and in files of earlier versions.",
    )
    channels: ChannelsSummary | None = Field(
        None,
        description="How well what was measured beside the picture was recorded, such as the vacuum; null "
        "where nothing was to be.",
    )
    labels: dict[str, str]
    note: str
    marks: list[MarkDocument] = Field(default_factory=list, description="Marked fields, in order.")
    pinned: bool
    size_bytes: int
    rig: JsonObject | None = Field(
        None,
        description="What its points tell about camera and mirrors: the worst verdict (fits, corrected, "
        "doubtful, moved, unmatched) and the means of shift_px and ratio; with marks on the cup, "
        "corrected_px, the largest movement taken off either view; null where the points tell nothing.",
    )
    field_order: FieldOrderDocument | None = Field(
        None,
        description="What the points of moving targets, measured during the capture, tell about the sequence "
        "of its fields in time; null where none were measured, and for progressive pictures.",
    )

    @property
    def in_list(self) -> "CaptureDocument":
        """The capture as one of many."""
        further = max(len(self.runs) - MOST_IN_LISTS, 0)
        changes = {
            "ledger": self.ledger.shortened(MOST_IN_LISTS),
            "runs": self.runs[-MOST_IN_LISTS:],
            "runs_not_listed": self.runs_not_listed + further,
        }
        return self.model_copy(update=changes)

    @property
    def disarmed(self) -> "CaptureDocument":
        """The capture after it was stopped while armed."""
        return self.model_copy(
            update={"state": "disarmed", "ended_because": "stopped before it was triggered"}
        )


class CaptureGroup(GroupDocument):
    """Captures that start at the same moment."""

    model_config = with_examples(GROUP)

    captures: list[CaptureDocument] = Field(description="Captures that exist; deleted ones are left out.")


MOST_AT_ONCE = 100
Selected = Annotated[
    list[CaptureName], Field(min_length=1, max_length=MOST_AT_ONCE, description="Ids of captures.")
]


class FacetValue(Document):
    """A value, and how many captures have it."""

    value: str
    count: int


class FacetsDocument(Document):
    """Values of the captures that match, the most frequent first, at most fifty each; days the newest first.

    Values of what is filtered by are counted without that filter: what another choice would give.
    """

    device: list[FacetValue]
    verdict: list[FacetValue] = Field(description="complete, incomplete, damaged.")
    pinned: list[FacetValue] = Field(description="1 and 0.")
    analysed: list[FacetValue] = Field(description="1: it has an analysis; 0.")
    calibration: list[FacetValue] = Field(description="Ids of those that the newest runs were made with.")
    days: list[FacetValue] = Field(description="Such as 2026-03-01, in the time zone that was asked for.")
    labels: dict[str, list[FacetValue]] = Field(description="By name.")


class CaptureList(Document):
    """A page of captures."""

    captures: list[CaptureDocument]
    next: str | None = Next
    total: int = Field(description="Number of captures that match, on all pages.")
    in_all: int = Field(description="Number of captures there are.")
    facets: FacetsDocument | None = Field(None, description="Null unless asked for.")
    widths_mm: dict[str, list[float | None]] = Field(
        default_factory=dict,
        description="Course of the wall's width by capture, as from `captures/{capture_id}/widths`; captures "
        "for which nobody has asked yet are missing.",
    )


class WidthCourse(Document):
    """Course of the wall's width in few numbers."""

    widths_mm: list[float | None] = Field(
        description="Distance between the outermost facing targets that are seen, ten a second over six "
        "seconds in the middle of the capture; null where it was not measured; empty without points."
    )


class CapturesPatch(Document):
    """Changes to notes, labels and pins of several captures; whatever is left out stays."""

    model_config = with_examples(
        {"captures": ["20260301T094211003Z", "20260301T095502417Z"], "pinned": True, "labels": {"liner": "B"}}
    )

    captures: Selected
    note: str | None = Field(None, max_length=2000)
    pinned: bool | None = None
    labels: LabelChanges | None = Field(
        None, description="Labels to add to the present ones; null removes a label."
    )


class CaptureSelection(Document):
    """Several captures."""

    model_config = with_examples({"captures": ["20260301T094211003Z", "20260301T095502417Z"]})

    captures: Selected


class BatchFailure(Document):
    """A capture that something could not be done with."""

    capture: str
    detail: str
    hint: str


class BatchDocument(Document):
    """Result of what was asked for several captures, each by itself."""

    done: list[str] = Field(description="Ids of the captures that it was done with.")
    failed: list[BatchFailure]
    jobs: list[str] = Field(default_factory=list, description="Ids of the jobs that were queued.")
