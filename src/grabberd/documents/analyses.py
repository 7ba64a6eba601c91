"""Analyses of a capture."""

from typing import Any

from pydantic import Field

from grabberd.documents.document import Document
from grabberd.documents.named_types import JsonObject


class AnalysisRow(Document):
    """An analysis in a list; of a damaged one only `analysis` and `problem` are known."""

    analysis: int = Field(description="Number of the analysis, from 1; no analysis is ever overwritten.")
    created_utc: str | None = None
    version: str | None = None
    device: str | None = Field(None, description="Name of the device that captured it.")
    run: int | None = Field(None, description="Run whose points were analysed.")
    bursts: list[str] = Field(
        default_factory=list, description="Further captures that were merged with it by phase."
    )
    inputs: JsonObject = Field(default_factory=dict, description="Inputs as they were given.")
    lacks: list[str] = Field(default_factory=list, description="Missing inputs and their consequences.")
    problems: list[str] = Field(
        default_factory=list, description="Problems in spite of which the analysis was completed."
    )
    summary: dict[str, float | None] = Field(
        default_factory=dict, description="The row of the table `summary`, by column name."
    )
    missing_extra: str | None = Field(
        None, description="Optional part that draws the report and was not installed."
    )
    page_problem: str | None = Field(None, description="Any other reason why there is no page.")
    problem: str | None = Field(None, description="Why the analysis cannot be used.")


class AnalysisList(Document):
    """A capture's analyses, newest first."""

    analyses: list[AnalysisRow]


class MapDocument(Document):
    """The targets of one field, or of one phase of the mean cycle."""

    field: int | None
    phase: float | None
    units: dict[str, str] = Field(description="Unit of each column, by column name.")
    columns: dict[str, list[Any]] = Field(
        description="One value per target, in the same sequence in every column; null where there is none."
    )
