"""A study: the quantities of many analysed captures side by side, groups of captures compared."""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.documents.document import Document
from grabberd_liner.analyses.documents import TableDocument

StudyVerdict = TypeAliasType("StudyVerdict", Literal["", "differ", "no difference shown", "not tested"])
TrendVerdict = TypeAliasType("TrendVerdict", Literal["changes", "no change shown", "not tested"])


class StudyResult(Document):
    """A mean, or a change, with σ and what judges it; null where that is not known."""

    value: float | None
    sigma: float | None
    common: float | None = Field(description="Part of `sigma` that no number of captures lessens.")
    half_width: float | None = Field(description="Half of the 95 % interval.")
    dof: float | None = Field(description="Degrees of freedom of σ; null without scatter to judge by.")
    p: float | None = Field(description="Probability of a value at least as far from 0 if it were 0.")


class StudyDifference(StudyResult):
    """Two groups compared, the second less the first; `p` is adjusted after Holm for all pairs."""

    first: int = Field(description="Index into the quantity's `groups`.")
    second: int
    verdict: StudyVerdict


class StudyTrend(StudyResult):
    """The slope that all groups share."""

    verdict: TrendVerdict


class StudyValues(Document):
    """A quantity in every capture that has it."""

    capture: list[str] = Field(description="Ids.")
    group: list[int] = Field(description="Indices into the quantity's `groups`.")
    place: list[float | None] = Field(description="On the axis of the trend; null without one.")
    value: list[float]
    sigma: list[float | None]


class QuantityStudied(Document):
    """A quantity over the captures."""

    name: str
    title: str
    definition: str
    unit: str = Field(description="1 for a ratio.")
    verdict: StudyVerdict = Field(description="`differ` if any two groups do; empty without groups.")
    remarks: list[str]
    groups: list[str]
    values: StudyValues
    means: list[StudyResult] = Field(description="One for each group.")
    differences: list[StudyDifference]
    trend: StudyTrend | None
    slopes: list[StudyResult | None] | None


class StudyQuestionDocument(Document):
    """Question of a study: what was compared with what."""

    by: str | None
    within: str | None
    unit: str | None
    over: str | None
    quantities: list[str]


class StudyLeftOut(Document):
    """A capture that takes no part, or a quantity that some captures lack, and why."""

    capture: str = Field(description="Its id; empty where a quantity is counted.")
    quantity: str = Field(description="Its name; empty where the whole capture is left out.")
    reason: str
    count: int


class StudyDocument(Document):
    """A study, as `grabberd study` writes it."""

    schema_: Literal["grabberd/study/1"] = Field(alias="schema")
    created_utc: str
    version: str
    select: list[str] = Field(description="Ids of the captures that were asked for.")
    question: StudyQuestionDocument
    over_unit: str
    over_label: str
    groups: list[str]
    captures: int = Field(description="Number of captures that take part.")
    remarks: list[str]
    quantities: list[QuantityStudied]
    left_out: list[StudyLeftOut]
    tables: dict[str, TableDocument] = Field(
        description="captures, quantities, groups, comparison, trend and left_out."
    )
