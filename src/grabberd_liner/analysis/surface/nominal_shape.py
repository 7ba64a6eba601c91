"""The object's nominal shape as a smooth surface: the prior's mean."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import ORDERS, Jets, index

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

    origin_mm: NDArray[np.float64]
    along: NDArray[np.float64]
    up: NDArray[np.float64]
    side: NDArray[np.float64]
    radius_mm: float
    turn_per_mm: float
    start: float

    def jets(self, u_mm: NDArray[np.float64], v_mm: NDArray[np.float64]) -> Jets:
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


def _axes(grid: Grid) -> NDArray[np.float64]:
    """(3, 3) rows: along the grid's rows, up (away from the middle of the arc's ends), side."""
    design = np.column_stack([np.ones(len(grid)), grid.u_mm, grid.v_mm, grid.v_mm**2])
    _, along, across, bend = np.linalg.lstsq(design, grid.nominal_mm, rcond=None)[0]
    along = along / np.linalg.norm(along)
    side = across + 2 * bend * grid.v_mm.mean()
    side = side - (side @ along) * along
    side = side / np.linalg.norm(side)
    return np.stack([along, np.cross(side, along), side])


def _circle(places: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """Centre and radius of the circle through (N, 2) positions; None if they are practically straight."""
    design = np.column_stack([2 * places, np.ones(len(places))])
    solution, _, rank, _ = np.linalg.lstsq(design, (places**2).sum(axis=1), rcond=1e-9)
    square = solution[2] + solution[:2] @ solution[:2]
    if rank < 3 or square <= 0 or square > 1e6 * np.ptp(places, axis=0).max() ** 2:
        return None
    return solution[:2], float(np.sqrt(square))


def _turn(grid: Grid, spokes: NDArray[np.float64]) -> tuple[float, float]:
    """Angle per mm of v, and angle at v = 0, of positions (N, 2) round their centre."""
    angle = np.arctan2(spokes[:, 1], spokes[:, 0])
    chord = min(grid.v_pitch_mm / (2 * np.linalg.norm(spokes, axis=1).mean()), 1.0)
    turns = np.array([1, -1]) * 2 * np.arcsin(chord) / grid.v_pitch_mm
    pointers = np.exp(1j * (angle - np.multiply.outer(turns, grid.v_mm))).mean(axis=1)
    best = int(np.argmax(np.abs(pointers)))
    return float(turns[best]), float(np.angle(pointers[best]))


def _adjusted(grid: Grid, frame: NDArray[np.float64], unknowns: NDArray[np.float64]) -> NominalShape:
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
