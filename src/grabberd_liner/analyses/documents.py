"""Documents of a capture's analyses, the request for one, and the method by which an analysis found its
pressures.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from typing_extensions import TypeAliasType

from grabberd.documents.document import Document, JobProblem, JsonObject, Next, with_examples
from grabberd.documents.requests import CaptureName
from grabberd_liner.profiles.documents import ProfileUse

PRESSURE_METHOD = "equilibrium"
"""Pressure as the load of a wall in equilibrium (docs/decisions). Earlier analyses name no method."""


RENAMED = {"overpressure_kpa": "teat_end_beyond_flow_stop_kpa"}
"""Quantities that earlier analyses call something they are not, and their names now."""
Outdated = Literal["", "pressure", "overpressure"]


def outdated(method: str | None, has_pressures: bool, quantities: Iterable[str]) -> Outdated:
    """Kind of mistake in an analysis of an earlier version; empty if there is none.

    Args:
        method: by which its pressures were found; None for the earlier, wrong way.
        has_pressures: true if it has any.
        quantities: names of its quantities, as they were stored.
    """
    if has_pressures and method is None:
        return "pressure"
    return "overpressure" if not RENAMED.keys().isdisjoint(quantities) else ""


def _current_name(name: object) -> object:
    return RENAMED.get(name, name) if isinstance(name, str) else name


_METHOD = (
    "How pressures were found: `equilibrium`, as the load of a wall in equilibrium; null in earlier ones, "
    "whose pressures are wrong."
)

AnalysisState = TypeAliasType("AnalysisState", Literal["queued", "running", "done", "failed", "cancelled"])


class QuantityDocument(Document):
    """One of the field's own quantities, as in the table `quantities`, whose rows have its definition."""

    name: Annotated[str, BeforeValidator(_current_name)]
    unit: str
    value: float | None = Field(description="Null if nothing was found.")
    sigma: float | None = Field(description="Its standard deviation, in the same unit.")
    sigma_common: float | None = Field(
        None,
        description="Part of `sigma` that captures analysed with the same liner values, gauges and model "
        "share: averaging them does not lessen it. Null in earlier ones.",
    )
    verdict: str = Field("", description="By the limit that a standard sets; empty if there is none.")
    reason: str = Field("", description="Why nothing was found.")


class AnalysisRecord(Document):
    """Origin of an analysis, and a summary of its results."""

    created_utc: str | None = None
    version: str | None = None
    job: str | None = Field(None, description="Id of the job that made it; null in earlier ones.")
    device: str | None = Field(None, description="Name of the device that captured it.")
    run: int | None = Field(None, description="Run whose points were analysed.")
    pressure_method: str | None = Field(None, description=_METHOD)
    bursts: list[str] = Field(
        default_factory=list, description="Further captures that were merged with it by phase."
    )
    inputs: JsonObject = Field(
        default_factory=dict, description="Inputs as they were given, and as profiles completed them."
    )
    profiles: list[ProfileUse] = Field(
        default_factory=list, description="Versions of the profiles that inputs came from."
    )
    lacks: list[str] = Field(default_factory=list, description="Missing inputs and their consequences.")
    problems: list[str] = Field(
        default_factory=list, description="Problems in spite of which the analysis was completed."
    )
    summary: dict[str, float | None] = Field(
        default_factory=dict, description="The row of the table `summary`, by column name."
    )
    quantities: list[QuantityDocument] = Field(
        default_factory=list, description="The table `quantities`; empty in earlier ones."
    )
    missing_extra: str | None = Field(
        None, description="Optional part that draws the report and was not installed."
    )
    page_problem: str | None = Field(None, description="Any other reason why there is no page.")


class AnalysisResult(AnalysisRecord):
    """Result of a job `analyse`: the record of the analysis that it has stored."""

    analysis: int = Field(description="Number of the analysis.")


class AnalysisRow(AnalysisRecord):
    """An analysis in a list; of a damaged one only `analysis` and `problem` are known."""

    analysis: int = Field(description="Number of the analysis, from 1; no analysis is ever overwritten.")
    outdated_pressure: bool = Field(
        False,
        description="True if its pressures were found in the earlier, wrong way: analyse the capture again.",
    )
    outdated_overpressure: bool = Field(
        False,
        description="True if its files say `overpressure_kpa` for `teat_end_beyond_flow_stop_kpa`: a contact "
        "pressure, and no pressure difference.",
    )
    problem: str | None = Field(None, description="Why the analysis cannot be used.")

    @property
    def outdated(self) -> Outdated:
        """Kind of mistake in it; empty if there is none."""
        if self.outdated_pressure:
            return "pressure"
        return "overpressure" if self.outdated_overpressure else ""


class AnalysisList(Document):
    """A page of a capture's analyses, newest first."""

    analyses: list[AnalysisRow]
    next: str | None = Next


class AnalysisPreparation(Document):
    """Inputs that an analysis would be made with if it were asked for now; nothing is computed or kept."""

    run: int = Field(description="Run whose points would be analysed.")
    inputs: JsonObject = Field(description="The inputs, completed; the text of a vacuum log is left out.")
    sources: dict[str, str] = Field(
        default_factory=dict,
        description="Where inputs come from that the request lacks, by name, such as `vacuum.liner`.",
    )
    profiles: list[ProfileUse] = Field(
        default_factory=list, description="Versions of the profiles that inputs come from."
    )
    obtained: dict[str, str] = Field(
        default_factory=dict,
        description="How the values of the wall were obtained, by name, as the liner's profile tells.",
    )
    recorded: list[str] = Field(
        default_factory=list, description="Quantities that were recorded with the capture."
    )
    lacks: list[str] = Field(default_factory=list, description="Missing inputs and their consequences.")
    problems: list[str] = Field(
        default_factory=list, description="Everything for which the analysis would be refused."
    )
    hint: str = Field("", description="What to do about these.")


class ColumnDocument(Document):
    """A column of a table."""

    name: str
    unit: str
    meaning: str
    values: list[float | str | None] = Field(description="One value per row; null where there is none.")


class TableDocument(Document):
    """A table, column by column."""

    meaning: str
    columns: list[ColumnDocument]


class TargetState(Document):
    """The targets of one field, or of one phase of the mean cycle."""

    name: str
    n: int | None = Field(None, description="Number of the field.")
    phase: float | None = None
    targets: TableDocument


class AnalysisDocument(Document):
    """An analysis in numbers, from which its report is drawn."""

    schema_: Literal["grabberd/analysis-report/1"] = Field(alias="schema")
    id: str = Field(description="Id of the capture.")
    created_utc: str
    version: str
    pressure_method: str | None = Field(None, description=_METHOD)
    about: JsonObject = Field(description="What was analysed: capture, run, calibration, object, ledger, …")
    inputs: JsonObject = Field(description="Inputs as given, what they lack, and where they come from.")
    problems: list[str]
    grid: JsonObject = Field(description="The target grid: target, row, column, u_mm, v_mm, triangles.")
    wall_phases: list[JsonObject] | None = Field(description="Bounds of each wall phase, from 0 to 1.")
    tables: dict[str, TableDocument] = Field(
        description="summary, fields, sections, phases, phase_sections, cycles and gaps."
    )
    states: list[TargetState] = Field(description="The targets in the middle of each wall phase.")


class MapDocument(Document):
    """The targets of one field, or of one phase of the mean cycle."""

    field: int | None
    phase: float | None
    units: dict[str, str] = Field(description="Unit of each column, by column name.")
    columns: dict[str, list[Any]] = Field(
        description="One value per target, in the same sequence in every column; null where there is none."
    )


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
        "compression above the gas in the liner and above atmosphere, overpressure, teat load, opening and "
        "closing time, rate, ratio and stroke; of a ramp with the empty liner touch point and critical "
        "collapsing pressure difference and bending stiffness; empty for an analysis of an earlier version.",
    )
    problem: JobProblem | None = Field(None, description="Why the analysis came to nothing.")


class DeviceAnalysis(CaptureAnalysis):
    """The analysis that ended last of those of a device's captures."""

    capture: str = Field(description="Id of the capture.")


class PulsationDocument(Document):
    """Latest known pulsation rate of the liner before a device; all null where it is not known."""

    rate_per_min: float | None = Field(description="Pulsations per minute.")
    capture: str | None = Field(
        description="The device's newest analysed capture, from which the rate was determined."
    )
    analysis: int | None = Field(description="Number of its analysis.")


CAPTURE_ANALYSIS = Annotated[
    CaptureAnalysis | None,
    Field(None, description="Its latest analysis; null if none was ever asked for, by whomever."),
]
"""Field `analysis` of a capture."""
LATEST_ANALYSIS = Annotated[
    DeviceAnalysis | None,
    Field(None, description="Null until one has ended; those of the last month are known after a restart."),
]
"""Field `latest_analysis` of a device."""


class AnalysisRequest(Document):
    """An analysis to run; missing inputs are not assumed, but reported as missing."""

    model_config = with_examples(
        {
            "inputs": {
                "reference": "nominal",
                "material": {"E_mpa": 3, "wall_mm": 2.5, "poisson": 0.5, "F0_n": 60, "radius_mm": 12.5},
                "vacuum": {"pulsation": {"kpa": 0, "sigma_kpa": 0.5}, "liner": {"kpa": 42, "sigma_kpa": 0.5}},
                "plane": "symmetry",
                "sought_kpa": 1,
            },
            "bursts": ["20260301T093100250Z-barn"],
        },
        {"profiles": True},
    )

    inputs: JsonObject = Field(
        default_factory=dict,
        description="What is known in addition to the points, as in `grabberd analyse --inputs`: reference, "
        "material, vacuum, plane, heights_mm, phases, sought_kpa.",
    )
    bursts: list[CaptureName] = Field(
        default_factory=list,
        max_length=100,
        description="Ids of further captures of the same liner, to be merged with it by phase.",
    )
    run: int | None = Field(
        None, ge=1, le=2**53, description="Run whose points to analyse; default: the latest."
    )
    vacuum_log: str | None = Field(None, description="Text of a vacuum logger's CSV file.")
    profiles: bool = Field(
        False,
        description="Complete the inputs from the profiles that the capture's labels `liner`, `pulsator`, "
        "`cup` and `cow` name; what is in `inputs` wins.",
    )
    configured: bool = Field(
        False,
        description="Take the inputs that the configuration names for the device, "
        "`devices.NAME.analysis.inputs`, where `inputs` has none, as analyses do that follow a capture by "
        "themselves.",
    )
