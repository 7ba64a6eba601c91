"""Analyses as they are asked for and shown."""

from typing import Annotated, Any

from pydantic import Field, StringConstraints

from grabberd.api.routes.models import Document, shown
from grabberd.api.routes.named_types import JsonObject

CaptureName = Annotated[str, StringConstraints(pattern=r"^[0-9A-Za-z_-]{1,80}$")]


class AnalysisOrder(Document):
    """An analysis as it is asked for; what is not given is not assumed, but said to lack."""

    model_config = shown(
        {
            "inputs": {
                "reference": "nominal",
                "material": {"E_mpa": 3, "wall_mm": 2.5, "poisson": 0.5, "F0_n": 60, "radius_mm": 12.5},
                "vacuum": {
                    "pulsation": {"kpa": 0, "sigma_kpa": 0.5},
                    "liner": {"kpa": 42, "sigma_kpa": 0.5},
                },
                "plane": "symmetry",
                "sought_kpa": 1,
            },
            "bursts": ["20260301T093100250Z-barn"],
        }
    )

    inputs: JsonObject = Field(
        default_factory=dict,
        description="What is known beside the points, as `grabberd analyse --inputs` takes it: reference, "
        "material, vacuum, plane, heights_mm, phases, sought_kpa, free_rows.",
    )
    bursts: list[CaptureName] = Field(
        default_factory=list,
        max_length=100,
        description="Ids of further captures of the same liner, put together with it by phase.",
    )
    run: int | None = Field(None, ge=1, le=2**53, description="Whose points; default: the latest.")
    vacuum_log: str | None = Field(None, description="Text of a vacuum logger's CSV file.")


class AnalysisRow(Document):
    """An analysis as it is listed; of a damaged one only number and `problem` are known."""

    analysis: int = Field(description="Its number, from 1; nothing is overwritten.")
    created_utc: str | None = None
    version: str | None = None
    device: str | None = Field(None, description="Name of the device that captured it.")
    run: int | None = Field(None, description="Whose points.")
    bursts: list[str] = Field(default_factory=list, description="Captures put together with it by phase.")
    inputs: JsonObject = Field(default_factory=dict, description="As they were given.")
    lacks: list[str] = Field(default_factory=list, description="What was not given, and its consequence.")
    problems: list[str] = Field(default_factory=list, description="What was survived.")
    summary: dict[str, float | None] = Field(
        default_factory=dict, description="The row of the table `summary`, by the names of its columns."
    )
    missing_extra: str | None = Field(None, description="What is not installed that draws the report.")
    page_problem: str | None = Field(None, description="Why else there is no page.")
    problem: str | None = Field(None, description="Why it cannot be used.")


class AnalysisList(Document):
    """A capture's analyses, the newest first."""

    analyses: list[AnalysisRow]


class MapDocument(Document):
    """The targets of one field, or of one phase of the mean cycle."""

    field: int | None
    phase: float | None
    units: dict[str, str] = Field(description="By the name of a column.")
    columns: dict[str, list[Any]] = Field(
        description="A value for each target, in the same order everywhere; null where there is none."
    )
