"""The target grid: material coordinates of the targets, their neighbours, and the object's nominal shape as
a smooth surface, the prior's mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.surface.jets import ORDERS, Jets, index

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
    nominal_mm: Array
    u_mm: Array
    v_mm: Array
    u_pitch_mm: float
    v_pitch_mm: float
    outward: float
    triangles: Indices
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

    def indices(self, target: NDArray[np.int32]) -> Indices:
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

    def pairs(self) -> Indices:
        """(K, 2) indices of the targets next to each other along a row or a column, each pair once."""
        place = _place(self.row, self.column)
        along = np.stack([place[:-1, :-1], place[1:, :-1]], axis=-1).reshape(-1, 2)
        across = np.stack([place[:-1, :-1], place[:-1, 1:]], axis=-1).reshape(-1, 2)
        pairs = np.concatenate([along, across])
        return pairs[(pairs >= 0).all(axis=1)]

    def adjoining_triangles(self) -> Indices:
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


def _pitch(xyz: Array, along: NDArray[np.int32], across: NDArray[np.int32]) -> float:
    """Mean distance of targets that differ by one in `along` alone; 1 mm where there are none."""
    order = np.lexsort((along, across))
    first, second = order[:-1], order[1:]
    beside = (across[first] == across[second]) & (along[second] - along[first] == 1)
    steps = np.linalg.norm(xyz[second[beside]] - xyz[first[beside]], axis=1)
    return float(steps.mean()) if len(steps) else 1.0


def _place(row: NDArray[np.int32], column: NDArray[np.int32]) -> Indices:
    """(rows + 1, columns + 1) index of the target at each grid place, −1 where there is none."""
    place = np.full((row.max() + 2, column.max() + 2), -1, np.intp)
    place[row, column] = np.arange(len(row))
    return place


def _cells(row: NDArray[np.int32], column: NDArray[np.int32]) -> Indices:
    """(K, 4) indices of four neighbours: (r, c), (r + 1, c), (r + 1, c + 1), (r, c + 1)."""
    place = _place(row, column)
    cells = np.stack([place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]], axis=-1).reshape(-1, 4)
    return cells[(cells >= 0).all(axis=1)]


def _outward(xyz: Array, cells: Indices) -> float:
    """The sign of the mean normal's z."""
    corner = xyz[cells]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]).sum(axis=0)
    return 1.0 if normal[2] >= 0 else -1.0


def _triangles(cells: Indices, outward: float) -> Indices:
    triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    triangles = triangles[np.lexsort((triangles[:, 2], triangles[:, 1], triangles[:, 0]))]
    return triangles if outward > 0 else triangles[:, [0, 2, 1]]


# A cylinder that misses the targets by more than a tenth of the pitch is no better prior mean than none.
_CLOSE = 0.1
_ITERATIONS = 30


@dataclass(frozen=True, slots=True, eq=False)
class NominalShape:
    """A cylinder X = origin + u · along + radius (cos φ · up + sin φ · side), φ = turn_per_mm · v + start.

    An open liner is a cylinder, whose derivatives are all known exactly; splines through six columns would
    not give them. An object that is no cylinder has radius 0: its shape is left to the spline.

    Attributes:
        origin_mm, along, up, side: (3,); along is ∂X/∂u, up and side are unit vectors across it.
        radius_mm: radius of the targets' face; 0 for no cylinder.
        turn_per_mm: angle per mm of v; `start`: angle at v = 0.
    """

    origin_mm: Array
    along: Array
    up: Array
    side: Array
    radius_mm: float
    turn_per_mm: float
    start: float

    def jets(self, u_mm: Array, v_mm: Array) -> Jets:
        """(N, 15, 3)."""
        jets = np.zeros((len(u_mm), len(ORDERS), 3))
        jets[:, 0] = self.origin_mm + np.multiply.outer(u_mm, self.along)
        jets[:, index(1, 0)] = self.along
        angle = self.turn_per_mm * v_mm + self.start
        cosine, sine = (
            self.radius_mm * np.cos(angle)[:, np.newaxis],
            self.radius_mm * np.sin(angle)[:, np.newaxis],
        )
        ring, turned = cosine * self.up + sine * self.side, cosine * self.side - sine * self.up
        for j, part in enumerate((ring, turned, -ring, -turned, ring)):
            jets[:, index(0, j)] += self.turn_per_mm**j * part
        return jets

    @classmethod
    def none(cls) -> "NominalShape":
        """No shape: X = 0."""
        return cls(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0)

    @classmethod
    def of(cls, grid: Grid) -> "NominalShape":
        """The cylinder through a grid's nominal positions, if it fits within a tenth of the pitch."""
        frame = _axes(grid)
        section = (grid.nominal_mm - grid.nominal_mm.mean(axis=0)) @ frame.T
        circle = _circle(section[:, 1:])
        if circle is None:
            return cls.none()
        centre, radius = circle
        shape = _adjusted(grid, frame, np.array([*centre, radius, *_turn(grid, section[:, 1:] - centre)]))
        off = shape.jets(grid.u_mm, grid.v_mm)[:, 0] - grid.nominal_mm
        near = np.sqrt((off**2).sum(axis=1).mean()) < _CLOSE * min(grid.u_pitch_mm, grid.v_pitch_mm)
        return shape if near else cls.none()


def _axes(grid: Grid) -> Array:
    """(3, 3) rows: along the grid's rows, up (away from the middle of the arc's ends), side."""
    design = np.column_stack([np.ones(len(grid)), grid.u_mm, grid.v_mm, grid.v_mm**2])
    _, along, across, bend = np.linalg.lstsq(design, grid.nominal_mm, rcond=None)[0]
    along = along / np.linalg.norm(along)
    side = across + 2 * bend * grid.v_mm.mean()
    side = side - (side @ along) * along
    side = side / np.linalg.norm(side)
    return np.stack([along, np.cross(side, along), side])


def _circle(places: Array) -> tuple[Array, float] | None:
    """Centre and radius of the circle through (N, 2) positions; None if they are practically straight."""
    design = np.column_stack([2 * places, np.ones(len(places))])
    solution, _, rank, _ = np.linalg.lstsq(design, (places**2).sum(axis=1), rcond=1e-9)
    square = solution[2] + solution[:2] @ solution[:2]
    if rank < 3 or square <= 0 or square > 1e6 * np.ptp(places, axis=0).max() ** 2:
        return None
    return solution[:2], float(np.sqrt(square))


def _turn(grid: Grid, spokes: Array) -> tuple[float, float]:
    """Angle per mm of v, and angle at v = 0, of positions (N, 2) round their centre."""
    angle = np.arctan2(spokes[:, 1], spokes[:, 0])
    chord = min(grid.v_pitch_mm / (2 * np.linalg.norm(spokes, axis=1).mean()), 1.0)
    turns = np.array([1, -1]) * 2 * np.arcsin(chord) / grid.v_pitch_mm
    pointers = np.exp(1j * (angle - np.multiply.outer(turns, grid.v_mm))).mean(axis=1)
    best = int(np.argmax(np.abs(pointers)))
    return float(turns[best]), float(np.angle(pointers[best]))


def _adjusted(grid: Grid, frame: Array, unknowns: Array) -> NominalShape:
    """Gauss–Newton adjustment of centre, radius, turn and start; the axis is fitted to all rows."""
    middle = grid.nominal_mm.mean(axis=0)
    section = (grid.nominal_mm - middle) @ frame.T
    for _ in range(_ITERATIONS):
        y, z, r, turn, start = unknowns
        phi = turn * grid.v_mm + start
        cos, sin = np.cos(phi), np.sin(phi)
        off = np.concatenate([section[:, 1] - y - r * cos, section[:, 2] - z - r * sin])
        one, zero = np.ones_like(phi), np.zeros_like(phi)
        upper = np.column_stack([one, zero, cos, -r * sin * grid.v_mm, -r * sin])
        lower = np.column_stack([zero, one, sin, r * cos * grid.v_mm, r * cos])
        unknowns = unknowns + np.linalg.lstsq(np.concatenate([upper, lower]), off, rcond=None)[0]
    y, z, r, turn, start = unknowns
    stretch, first = np.polyfit(grid.u_mm, section[:, 0], 1)
    origin = middle + np.array([first, y, z]) @ frame
    return NominalShape(origin, stretch * frame[0], frame[1], frame[2], float(r), float(turn), float(start))
