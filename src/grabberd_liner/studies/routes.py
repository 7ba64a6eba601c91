"""Studies: captures compared.

A study: the quantities of many analysed captures side by side, groups of captures compared.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd import __version__
from grabberd.documents.document import Document, JsonObject, Label
from grabberd.documents.requests import CaptureName
from grabberd.runtime import SystemClock, iso_utc
from grabberd.server.api.readings import reads
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.work.process import Processes
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


NOT_THERE = "there is no such capture"


def study_in_process(
    processes: Processes, directory: Path, captures: Sequence[str], by: str | None, within: str | None
) -> JsonObject:
    """The document of a study.

    Args:
        processes: Where that process is kept.
        directory: The state directory.
        captures: Ids of captures.
        by: What makes the groups; None: all are one.
        within: What has several groups, so that they are compared within it.

    Raises:
        InputError: None of them is there.
        StorageError: The archive cannot be read, or the process does not answer.
    """
    question = {"directory": str(directory), "captures": list(captures), "by": by, "within": within}
    return processes.ask(f"{__name__}:answer", question, "makes studies")


def study_of(directory: Path, captures: Sequence[str], by: str | None, within: str | None) -> JsonObject:
    """The document of a study, made here; see `study_in_process`."""
    from grabberd_liner.chain.study.study import ID, LeftOut, StudyQuestion, make_study  # noqa: PLC0415 - the core
    from grabberd_liner.chain.study.study_document import study_document, tables  # noqa: PLC0415
    from grabberd_liner.studies.captures import Condition, LocalArchive, Selection, captures_of_archive  # noqa: PLC0415

    selection = Selection((), (Condition(ID, tuple(captures)),))
    taken, left_out = captures_of_archive(LocalArchive(directory), selection)
    there = {one.id for one in taken} | {one.capture for one in left_out}
    left_out += [LeftOut(one, "", NOT_THERE) for one in captures if one not in there]
    study = make_study(StudyQuestion(by, within), taken, left_out)
    about = {
        "created_utc": iso_utc(SystemClock().utc_now()),
        "version": __version__,
        "select": list(captures),
    }
    return study_document(study, tables(study), about)


def answer(asked: Any) -> JsonObject:
    """The document of a study, in the process that makes it."""
    return study_of(Path(asked["directory"]), asked["captures"], asked["by"], asked["within"])


router = APIRouter(prefix="/study", tags=["studies"], responses=PROBLEMS)

MOST = 100
Captures = Annotated[
    list[CaptureName],
    Query(min_length=1, max_length=MOST, description="Ids of captures; repeat the parameter."),
]
By = Annotated[Label | None, Query(description="What makes the groups: a label, device, date, or id.")]
Within = Annotated[Label | None, Query(description="Compare the groups within this, such as cow.")]


@router.get("", summary="Compare captures")
@reads
def study_captures(
    service: ServiceOf, captures: Captures, by: By = None, within: Within = None
) -> StudyDocument:
    """Compare the quantities of captures by their newest analyses: every value with σ, the means of groups,
    and their differences with a test, as `grabberd study` does. Captures and quantities that cannot take
    part are listed with the reason.
    """
    state = service.archive.directory.parent
    return StudyDocument.model_validate(study_in_process(service.processes, state, captures, by, within))
