"""A capture's latest analysis in short, as lists, devices and messages show it."""

from typing import Literal

from pydantic import Field
from typing_extensions import TypeAliasType

from grabberd.documents.document import Document
from grabberd.documents.job_problem import JobProblem
from grabberd_liner.analyses.documents import QuantityDocument

AnalysisState = TypeAliasType("AnalysisState", Literal["queued", "running", "done", "failed", "cancelled"])


class CaptureAnalysis(Document):
    """The latest analysis of a capture: asked for, made, or come to nothing."""

    state: AnalysisState = Field(
        description="Of the analysis that was asked for last; `failed` also if the capture cannot be "
        "analysed, so that none was queued."
    )
    job: str | None = Field(None, description="Id of its job, until that has ended.")
    analysis: int | None = Field(None, description="Number of the newest analysis that there is.")
    created_utc: str | None = Field(None, description="When that was made.")
    quantities: list[QuantityDocument] = Field(
        default_factory=list,
        description="Its main quantities with their standard deviations, those alone that were found: liner "
        "compression, overpressure, teat load, opening and closing time, rate, ratio and stroke; of a "
        "ramp with the empty liner touch point and critical collapsing pressure difference and bending "
        "stiffness; empty for an analysis of an earlier version.",
    )
    problem: JobProblem | None = Field(None, description="Why the analysis came to nothing.")


class DeviceAnalysis(CaptureAnalysis):
    """The analysis that ended last of those of a device's captures."""

    capture: str = Field(description="Id of the capture.")
