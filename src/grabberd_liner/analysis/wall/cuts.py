"""Constraints of the half tube: control values that are free or held, and the effect of the hidden half.

Three functions along each cut describe that effect: its shift towards the cameras (z), its turn about the
tube's axis, and the force across the wall there (y). If all are zero, the hidden half is the mirror image of
the seen one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from grabberd_liner.analysis.wall.shell import UNKNOWNS
from grabberd_liner.analysis.wall.splines import DEGREE, SplineGrid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_X, _Y, _Z, _SHEAR = range(UNKNOWNS)


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """Constraints of the half tube, with K control points of four values.

    Attributes:
        order: (K, 4) number of the unknown that each control value follows; −1 for a held one.
        count: number n of unknowns.
        free: (4 K, n) control values by the unknowns.
        moved: (4 K, 4 A) control values by the A control values of the shift of the cut at low θ, of that at
            high θ (mm), and of the two cuts' turns dy/ds (rad).
        forced: (n, 2 A) force on the unknowns by the control values of the force on the cuts along y per
            length of tube, low θ then high, N/mm; each counts as if it were constant over its spline.
    """

    order: Indices
    count: int
    free: sparse.csr_matrix
    moved: sparse.csr_matrix
    forced: sparse.csr_matrix

    @classmethod
    def of(cls, grid: SplineGrid) -> "Cuts":
        """Constraints on a grid."""
        around, along = grid.around.count, grid.along.count
        number = np.arange(grid.count * UNKNOWNS).reshape(along, around, UNKNOWNS)
        order, count = _ordered(_followed(number), _held(number))
        rows = np.flatnonzero(order >= 0)
        free = sparse.csr_matrix((np.ones(len(rows)), (rows, order[rows])), shape=(number.size, count))
        moved, forced = _moved(grid, number), free.T @ _forced(grid, number)
        return cls(order.reshape(grid.count, UNKNOWNS), count, free, moved, forced)


def _held(number: Indices) -> NDArray[np.bool_]:
    """True for control values that are held: z on a cut, and the clamped ends.

    An end's own control values are held, and those beside it in all but x, so that the wall leaves it at the
    mounted slope.
    """
    held = np.zeros(number.shape, bool)
    held[:, [0, -1], _Z] = True
    held[[0, -1]] = True
    held[[1, -2], :, 1:] = True
    return held.ravel()


def _followed(number: Indices) -> Indices:
    """(4 K,) control value that each one follows.

    On a cut, x, y and s follow those beside it, so that they have no slope there.
    """
    followed = number.copy()
    for axis in (_X, _Y, _SHEAR):
        followed[:, 0, axis] = number[:, 1, axis]
        followed[:, -1, axis] = number[:, -2, axis]
    return followed.ravel()


def _ordered(followed: Indices, held: NDArray[np.bool_]) -> tuple[Indices, int]:
    """Number of each control value's unknown, (4 K,), −1 for a held one; and the number of unknowns."""
    kept = np.unique(followed[~held & ~held[followed]])
    order = np.full(len(followed), -1, dtype=np.intp)
    order[kept] = np.arange(len(kept))
    return np.where(held, -1, order[followed]), len(kept)


def cut_points(grid: SplineGrid) -> Indices:
    """(A,) numbers along the tube of the control points that may move on a cut: all but the clamped ends'."""
    return np.arange(2, grid.along.count - 2)


def _moved(grid: SplineGrid, number: Indices) -> sparse.csr_matrix:
    inner = cut_points(grid)
    step_mm = grid.around.greville[1] - grid.around.greville[0]
    size = len(inner)
    # The slope at a spline's end is that between its last two control points.
    parts = [(0, _Z, 1.0), (-1, _Z, 1.0), (0, _Y, -step_mm), (-1, _Y, step_mm)]
    rows = np.concatenate([number[inner, side, axis] for side, axis, _ in parts])
    values = np.repeat([value for _, _, value in parts], size)
    shape = (number.size, len(parts) * size)
    return sparse.csr_matrix((values, (rows, np.arange(len(rows)))), shape=shape)


def _forced(grid: SplineGrid, number: Indices) -> sparse.csr_matrix:
    inner = cut_points(grid)
    knots = grid.along.knots
    # A spline's integral is its span of knots over its order.
    integral_mm = (knots[DEGREE + 1 :] - knots[: -DEGREE - 1])[inner] / (DEGREE + 1)
    rows = np.concatenate([number[inner, 0, _Y], number[inner, -1, _Y]])
    shape = (number.size, len(rows))
    return sparse.csr_matrix((np.tile(integral_mm, 2), (rows, np.arange(len(rows)))), shape=shape)
