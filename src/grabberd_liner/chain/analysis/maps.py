"""The maps of an analysis, as the page requests them: the columns of the targets in one state."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Table, json_values
from grabberd_liner.analysis import Grid
from grabberd_liner.chain.analysis.tables import AnalysisTables

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
    rounded: NDArray[Any] = np.round(values * scale) / scale
    return rounded
