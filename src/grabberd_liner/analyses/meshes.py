"""The wall of each analysed field and phase as a mesh, with the columns of its targets at the vertices."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Column, Rows, Table
from grabberd_liner.analysis import Grid
from grabberd_liner.chain.analysis.tables import AnalysisTables

Array = NDArray[Any]
_POSITION = ("x_mm", "y_mm", "z_mm")
_TABLES = {"targets": ("fields", "n", "field-{:08d}"), "phase_targets": ("phases", "phase", "phase-{:.4f}")}


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """The wall at one field or phase; targets without a position are left out.

    Attributes:
        series: `fields` or `phases`.
        name: Name of its file, without ending.
        time: Time in s, or phase.
        triangles: (K, 3) counter-clockwise as seen from outside.
        position: Columns x_mm, y_mm, z_mm: the targets on the smooth outer face, object's frame.
        columns: Columns of the values at the targets.
        rows: (M,) values of `position` and `columns`.
    """

    series: str
    name: str
    time: float
    triangles: Array
    position: tuple[Column, ...]
    columns: tuple[Column, ...]
    rows: Rows

    def __len__(self) -> int:
        return len(self.rows[_POSITION[0]])

    @property
    def xyz_mm(self) -> Array:
        """(M, 3) positions of the targets."""
        return np.column_stack([self.rows[column.name] for column in self.position])


def meshes(tables: AnalysisTables, grid: Grid) -> Iterator[Mesh]:
    """The meshes of the fields, then those of the phases."""
    for name in _TABLES:
        for first in range(0, len(tables[name]), len(grid)):
            yield _mesh(tables[name], slice(first, first + len(grid)), grid.triangles)


def _mesh(table: Table, part: slice, triangles: Array) -> Mesh:
    series, key, file_name = _TABLES[table.name]
    which = table.column(key)[part][0]
    time = table.column("time_s")[part][0] if "time_s" in table.rows else which
    numeric = [column for column in table.columns if column.dtype[0] in "if"]
    positions: Array = np.array([table.column(name)[part] for name in _POSITION])
    seen = np.asarray(np.isfinite(positions).all(axis=0))
    vertex = np.cumsum(seen) - 1
    return Mesh(
        series,
        file_name.format(which),
        float(time),
        vertex[triangles[seen[triangles].all(axis=1)]],
        tuple(column for column in numeric if column.name in _POSITION),
        tuple(column for column in numeric if column.name not in (key, "time_s", *_POSITION)),
        {column.name: table.column(column.name)[part][seen] for column in numeric},
    )
