"""Coverage of a run, which says how well it was measured: its verdict, its targets, its fields."""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.core.reconstruction.coverage import CoverageVerdict, FindingCode
from grabberd.documents.document import Document

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
    ],
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


class CoverageDocument(CoverageSummary):
    """Coverage of a run, target by target."""

    targets: list[TargetCoverage]
    worst_fields: list[FieldCoverage] = Field(
        description="The fields in which most targets were missed, at most twenty, in their order."
    )
