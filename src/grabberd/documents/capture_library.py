"""The library of captures: pages of it, what captures have in common, and what became of several at once."""

from typing import Annotated

from pydantic import Field

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import Document, Next, with_examples
from grabberd.documents.named_types import LabelChanges
from grabberd.documents.requests import CaptureName

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
