"""Targets that face the views, by the grid that they form: its normal at a target is the wall's."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig
from grabberd.core.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_OBLIQUE_DEG = 60.0
"""Angle between normal and line of sight up to which a disc is expected to be seen: at a larger one its image
has less than half of its width, and the grid's normal is not certain enough to tell what is hidden."""
CERTAIN_SIGMA = 2.0
"""Number of standard deviations by which a predicted normal may be wrong: a target that may be turned away
is not expected. A corner that was never seen is predicted from one side, and its normal is ten to twenty
degrees wrong while the wall closes."""
_LEAST_COSINE = math.cos(math.radians(MOST_OBLIQUE_DEG))


class Facing:
    """The targets of one object, before one rig."""

    def __init__(self, rig: Rig, model: ObjectModel) -> None:
        self._center_mm = rig.center_mm[:, :, 0]
        self._along, self._across = (_Slope.of(model, *step) for step in ((0, 1), (1, 0)))
        self._side = 1.0
        toward, _ = self._toward(model.xyz_mm)
        self._side = -1.0 if np.sign(toward).sum() < 0 else 1.0

    def both(self, xyz_mm: Array, sigma_mm: Array | None = None) -> Mask:
        """(M,) True for targets at these positions (M, 3) that face both views, or may do so.

        Args:
            xyz_mm: Positions.
            sigma_mm: (M,) their standard deviations, by which normals may be turned; None: there are none.
        """
        toward, length = self._toward(xyz_mm)
        least = _LEAST_COSINE if sigma_mm is None else self._least_cosine(xyz_mm, sigma_mm)
        # A row or a column alone has no normal: both are 0, and its targets may face anywhere.
        return np.logical_and.reduce(toward >= least * length, axis=0)

    def _least_cosine(self, xyz_mm: Array, sigma_mm: Array) -> Array:
        """(M,) cosines of the largest angles at which targets face a view for certain."""
        turned2 = sum(slope.turned2(xyz_mm, sigma_mm) for slope in (self._along, self._across))
        largest = np.maximum(math.radians(MOST_OBLIQUE_DEG) - CERTAIN_SIGMA * np.sqrt(turned2), 0.0)
        return np.cos(largest)

    def _toward(self, xyz_mm: Array) -> tuple[Array, Array]:
        """(V, M) products of the normals and the lines of sight, and of the lengths of both."""
        along, across = self._along.at(xyz_mm), self._across.at(xyz_mm)
        # np.cross is several times slower.
        normal = along[:, [1, 2, 0]] * across[:, [2, 0, 1]] - along[:, [2, 0, 1]] * across[:, [1, 2, 0]]
        sight = self._center_mm[:, np.newaxis] - xyz_mm
        length: Array = np.sqrt((normal * normal).sum(axis=1) * (sight * sight).sum(axis=2))
        return self._side * (sight * normal).sum(axis=2), length


class _Slope(NamedTuple):
    """Differences between neighbours along the rows, or along the columns, up to a factor.

    The mean of both sides where there are two neighbours; at the edge of the grid, where a curved wall is
    most oblique, a parabola through three targets if there are so many.

    Attributes:
        target: (3, M) indices of three targets.
        weight: (3, M) their weights; 0 for targets without a neighbour.
    """

    target: NDArray[np.intp]
    weight: Array

    @classmethod
    def of(cls, model: ObjectModel, rows: int, columns: int) -> "_Slope":
        at = {(int(r), int(c)): i for i, (r, c) in enumerate(zip(model.row, model.column, strict=True))}
        chosen = [_weighted(at, r, c, rows, columns) for r, c in at]
        target = np.array([one for one, _ in chosen], np.intp).T
        weight = np.array([one for _, one in chosen], np.float64).T
        return cls(target, weight)

    def at(self, xyz_mm: Array) -> Array:
        """(M, 3) of targets at these positions."""
        return (xyz_mm[self.target] * self.weight[:, :, np.newaxis]).sum(axis=0)

    def turned2(self, xyz_mm: Array, sigma_mm: Array) -> Array:
        """(M,) variances of the slope's direction in rad²; 0 without a neighbour."""
        square_mm2 = (self.at(xyz_mm) ** 2).sum(axis=1)
        variance_mm2 = ((self.weight * sigma_mm[self.target]) ** 2).sum(axis=0)
        return np.divide(variance_mm2, square_mm2, out=np.zeros_like(square_mm2), where=square_mm2 > 0.0)


def _weighted(
    at: Mapping[tuple[int, int], int], r: int, c: int, rows: int, columns: int
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Three targets, and their weights in the slope of the one at this row and column."""
    own = at[r, c]
    before, after = (at.get((r + k * rows, c + k * columns)) for k in (-1, 1))
    if before is not None and after is not None:
        return (before, own, after), (-1.0, 0.0, 1.0)
    side = 1 if after is not None else -1
    beside, next_one = (at.get((r + k * side * rows, c + k * side * columns)) for k in (1, 2))
    if beside is None:
        return (own, own, own), (0.0, 0.0, 0.0)
    if next_one is None:
        return (own, beside, own), (-2.0 * side, 2.0 * side, 0.0)
    return (own, beside, next_one), (-3.0 * side, 4.0 * side, -1.0 * side)
