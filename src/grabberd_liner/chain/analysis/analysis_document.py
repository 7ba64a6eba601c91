"""An analysis as JSON: one document, the source of its report and of the page, and the maps that the page
requests, the columns of the targets in one state.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Table, json_values
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.chain.analysis.analyse import Analysis
from grabberd_liner.chain.analysis.tables import AnalysisTables

SCHEMA = "grabberd/analysis-report/1"
WHOLE = (
    "summary",
    "ramp",
    "quantities",
    "fields",
    "sections",
    "phases",
    "phase_sections",
    "phase_profile",
    "cycles",
    "gaps",
    "agreement",
    "agreement_places",
)
"""Tables in the document; longer ones, with a row for each target, triangle or edge, are separate files."""
GRID = ("target", "row", "column", "u_mm", "v_mm", "triangles")
"""Attributes of the target grid in the document; a triangle's corners are indices into `target`."""

_ORIGIN = ("id", "created_utc", "version", "pressure_method")
_WALL_PHASES = {"a": "opening", "b": "open", "c": "closing", "d": "closed"}
# As many as there are wall phases, so that the report has the same layout with and without a pulsation.
_STATES = 4


class _Chosen(NamedTuple):
    """A state whose targets are in the document: the rows of `table` whose column `key` has that value."""

    name: str
    table: str
    key: str
    value: float


def analysis_document(analysis: Analysis, tables: AnalysisTables, about: Mapping[str, Any]) -> dict[str, Any]:
    """The document: inputs, problems, tables, and the targets of four states.

    Args:
        analysis: Analysis of the capture.
        tables: Tables of the analysis.
        about: Origin of the analysis: id (the capture's), created_utc, version, pressure_method, run, device,
            captured_utc, bits, note, object, calibration, bursts, and sources by the name of an input.
    """
    return {
        "schema": SCHEMA,
        **{key: about.get(key) for key in _ORIGIN},
        "about": {key: about[key] for key in about if key not in (*_ORIGIN, "sources")},
        "inputs": _inputs(analysis, about.get("sources") or {}),
        "problems": list(analysis.problems),
        "grid": {name: getattr(analysis.grid, name).tolist() for name in GRID},
        "wall_phases": _bounds(analysis),
        "tables": {name: table_document(tables[name]) for name in WHOLE},
        "states": [_state(analysis, tables[one.table], one) for one in _chosen(analysis)],
    }


def table_document(table: Table, rows: NDArray[Any] | None = None) -> dict[str, Any]:
    """A table, or some rows of it; unknown numbers are null."""
    use = slice(None) if rows is None else rows
    return {
        "meaning": table.meaning,
        "columns": [
            {
                "name": column.name,
                "unit": column.unit,
                "meaning": column.meaning,
                "values": json_values(table.column(column.name)[use]),
            }
            for column in table.columns
        ],
    }


def _inputs(analysis: Analysis, sources: Mapping[str, str]) -> dict[str, Any]:
    reference = analysis.inputs.reference
    return {
        "given": _without_log(analysis.inputs.given),
        "reference": None if reference is None else str(reference),
        "heights_mm": list(analysis.inputs.heights_mm),
        "phases": analysis.inputs.phases,
        "lacks": list(analysis.inputs.lacks),
        "sources": dict(sources),
    }


def _without_log(given: Mapping[str, Any]) -> dict[str, Any]:
    """The inputs with a summary in place of a logger's file, whose curve is in the tables."""
    vacuum = given.get("vacuum")
    if not isinstance(vacuum, Mapping) or not isinstance(vacuum.get("log"), str):
        return dict(given)
    lines = vacuum["log"].splitlines()
    summary = f"{len(lines)} lines, the first of them: {lines[0] if lines else ''}"
    return {**given, "vacuum": {**vacuum, "log": summary}}


def _bounds(analysis: Analysis) -> list[dict[str, Any]] | None:
    """Bounds of each wall phase within the mean cycle, from 0 to 1; None if there are none."""
    phases = analysis.cycle.wall if analysis.cycle else None
    if phases is None:
        return None
    share = phases.durations_s.value / phases.durations_s.value.sum()
    ends = np.cumsum(share)
    return [
        {"phase": letter, "name": name, "first": float(end - part), "end": float(end)}
        for (letter, name), end, part in zip(_WALL_PHASES.items(), ends, share, strict=True)
    ]


def _chosen(analysis: Analysis) -> list[_Chosen]:
    """The middle of each wall phase; without phases, fields spaced evenly over the capture."""
    bounds = _bounds(analysis)
    if bounds and len(analysis.phase):
        return [_in_the_middle(analysis, bound) for bound in bounds]
    count = len(analysis.fields)
    places = np.unique(np.linspace(0, count - 1, min(_STATES, count)).round().astype(int))
    numbers = [analysis.fields[place].n for place in places]
    return [_Chosen(f"field {n}", "targets", "n", n) for n in numbers]


def _in_the_middle(analysis: Analysis, bound: Mapping[str, Any]) -> _Chosen:
    middle = (bound["first"] + bound["end"]) / 2
    # Phases are cyclic: 0.95 and 0.05 are 0.1 apart.
    apart = np.abs((analysis.phase - middle + 0.5) % 1 - 0.5)
    nearest = float(analysis.phase[np.argmin(apart)])
    return _Chosen(f"{bound['name']} ({bound['phase']})", "phase_targets", "phase", nearest)


def _state(analysis: Analysis, table: Table, chosen: _Chosen) -> dict[str, Any]:
    rows = np.flatnonzero(table.column(chosen.key) == chosen.value)
    return {"name": chosen.name, chosen.key: chosen.value, "targets": table_document(table, rows)}


_KINDS = (("field", "targets", "n"), ("phase", "phase_targets", "phase"))
# More digits than any σ here warrants; the rest of a double would only make the page's documents larger.
_DIGITS = 6


class TargetMap(NamedTuple):
    """Columns of the targets in one state.

    Attributes:
        kind: `field` or `phase`.
        value: Number of the field, or phase.
        columns: Values at the targets by column name.
    """

    kind: str
    value: float
    columns: dict[str, list[Any]]


def target_maps(tables: AnalysisTables, grid: Grid) -> Iterator[TargetMap]:
    """The maps of all fields, then those of all phases; numbers have six digits."""
    for kind, name, key in _KINDS:
        table = tables[name]
        for first in range(0, len(table), len(grid)):
            rows = slice(first, first + len(grid))
            yield TargetMap(kind, float(table.column(key)[first]), _columns(table, rows, key))


def map_units(tables: AnalysisTables) -> dict[str, str]:
    """The unit of every column of a map."""
    return {column.name: column.unit for column in tables["targets"].columns}


def _columns(table: Table, rows: slice, key: str) -> dict[str, list[Any]]:
    return {
        column.name: json_values(_rounded(table.column(column.name)[rows]))
        for column in table.columns
        if column.name not in (key, "time_s")
    }


def _rounded(values: NDArray[Any]) -> NDArray[Any]:
    """Rounds to six significant digits."""
    if values.dtype.kind != "f":
        return values
    size = np.where(np.isfinite(values) & (values != 0), np.abs(values), 1.0)
    scale = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(size)))
    return np.round(values * scale) / scale
