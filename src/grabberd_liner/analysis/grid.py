"""The target grid: material coordinates of the targets, and their neighbours."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AnalysisError

# Curvature needs three points in each direction.
_LEAST = 3


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """N targets of an object model as a grid of material coordinates.

    The material coordinates u, v stay with the material through the capture: u = row · row pitch,
    v = column · column pitch, in mm.

    Attributes:
        target: (N,) int32, ids, ascending; `row`, `column`: (N,) int32, from 0.
        nominal_mm: (N, 3) positions in the object model.
        u_mm: (N,) material coordinates; `v_mm`: (N,).
        u_pitch_mm: mean distance of nominal neighbours in adjoining rows; `v_pitch_mm`: in columns.
        outward: 1.0 if X_u × X_v points outward (towards the cameras, +z, on the nominal object), else −1.0.
        triangles: (K, 3) indices of targets: two triangles for each cell of four, counter-clockwise seen from
            outside.
        homologous: True if a target is the same point of the material in every field; if False, the grid only
            shows where targets may be, and u, v are no material coordinates.
    """

    target: NDArray[np.int32]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    nominal_mm: NDArray[np.float64]
    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    u_pitch_mm: float
    v_pitch_mm: float
    outward: float
    triangles: NDArray[np.intp]
    homologous: bool = True

    def __len__(self) -> int:
        return len(self.target)

    @classmethod
    def of(cls, model: ObjectModel) -> "Grid":
        """The grid of an object model.

        Raises:
            AnalysisError: fewer than three rows or columns, or no four targets that make a cell.
        """
        row, column = model.row - model.row.min(), model.column - model.column.min()
        _check_size(model, row, column)
        u_pitch = _pitch(model.xyz_mm, row, column)
        v_pitch = _pitch(model.xyz_mm, column, row)
        cells = _cells(row, column)
        if not len(cells):
            raise AnalysisError(
                f"the object model {model.name!r} has no four targets that are neighbours",
                "give every target of the object file its row and column in the target grid",
            )
        outward = _outward(model.xyz_mm, cells)
        return cls(
            target=model.target,
            row=row,
            column=column,
            nominal_mm=model.xyz_mm,
            u_mm=row * u_pitch,
            v_mm=column * v_pitch,
            u_pitch_mm=u_pitch,
            v_pitch_mm=v_pitch,
            outward=outward,
            triangles=_triangles(cells, outward),
            homologous=model.homologous,
        )

    def indices(self, target: NDArray[np.int32]) -> NDArray[np.intp]:
        """(M,) indices of these ids in the grid.

        Raises:
            AnalysisError: an id is missing from the object model.
        """
        index = np.searchsorted(self.target, target)
        known = self.target[np.minimum(index, len(self.target) - 1)] == target
        if not known.all():
            names = ", ".join(map(str, np.unique(target[~known])[:10]))
            raise AnalysisError(
                f"the points have targets that the object model does not: {names}",
                "analyse the capture with the object model that it was measured with",
            )
        return index

    def pairs(self) -> NDArray[np.intp]:
        """(K, 2) indices of the targets next to each other along a row or a column, each pair once."""
        place = _place(self.row, self.column)
        along = np.stack([place[:-1, :-1], place[1:, :-1]], axis=-1).reshape(-1, 2)
        across = np.stack([place[:-1, :-1], place[:-1, 1:]], axis=-1).reshape(-1, 2)
        pairs = np.concatenate([along, across])
        return pairs[(pairs >= 0).all(axis=1)]

    def adjoining_triangles(self) -> NDArray[np.intp]:
        """(K, 2) indices of the triangles that share an edge."""
        edges = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        owner = np.repeat(np.arange(len(self.triangles)), 3)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        edges, owner = edges[order], owner[order]
        shared = (edges[1:] == edges[:-1]).all(axis=1)
        return np.column_stack([owner[:-1][shared], owner[1:][shared]])


def _check_size(model: ObjectModel, row: NDArray[np.int32], column: NDArray[np.int32]) -> None:
    rows, columns = int(row.max()) + 1, int(column.max()) + 1
    if min(rows, columns) < _LEAST:
        raise AnalysisError(
            f"the object model {model.name!r} has {rows} rows and {columns} columns: too few for a surface",
            f"a surface needs at least {_LEAST} rows and {_LEAST} columns of targets",
        )


def _pitch(xyz: NDArray[np.float64], along: NDArray[np.int32], across: NDArray[np.int32]) -> float:
    """Mean distance of targets that differ by one in `along` alone; 1 mm where there are none."""
    order = np.lexsort((along, across))
    first, second = order[:-1], order[1:]
    beside = (across[first] == across[second]) & (along[second] - along[first] == 1)
    steps = np.linalg.norm(xyz[second[beside]] - xyz[first[beside]], axis=1)
    return float(steps.mean()) if len(steps) else 1.0


def _place(row: NDArray[np.int32], column: NDArray[np.int32]) -> NDArray[np.intp]:
    """(rows + 1, columns + 1) index of the target at each grid place, −1 where there is none."""
    place = np.full((row.max() + 2, column.max() + 2), -1, np.intp)
    place[row, column] = np.arange(len(row))
    return place


def _cells(row: NDArray[np.int32], column: NDArray[np.int32]) -> NDArray[np.intp]:
    """(K, 4) indices of four neighbours: (r, c), (r + 1, c), (r + 1, c + 1), (r, c + 1)."""
    place = _place(row, column)
    cells = np.stack([place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]], axis=-1).reshape(-1, 4)
    return cells[(cells >= 0).all(axis=1)]


def _outward(xyz: NDArray[np.float64], cells: NDArray[np.intp]) -> float:
    """The sign of the mean normal's z."""
    corner = xyz[cells]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]).sum(axis=0)
    return 1.0 if normal[2] >= 0 else -1.0


def _triangles(cells: NDArray[np.intp], outward: float) -> NDArray[np.intp]:
    triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    triangles = triangles[np.lexsort((triangles[:, 2], triangles[:, 1], triangles[:, 0]))]
    return triangles if outward > 0 else triangles[:, [0, 2, 1]]
