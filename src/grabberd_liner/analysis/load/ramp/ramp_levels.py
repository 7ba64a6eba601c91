"""The states of a slow ramp with the empty liner, and which of them can be used for what."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.load_prior import Difference
from grabberd_liner.analysis.load.mounted.mounting import Mounting

Array = NDArray[np.float64]

_TERMS = 3
"""Of a row's height round the wall: level, slope, bend."""
_CREST_MM = 10.0
"""To both sides of the line that faces the cameras: farther out a collapsing wall folds, and is no parabola.

With targets at ±16 mm as well, the touch came out 2 to 4 kPa too high.
"""


class RampLevel(NamedTuple):
    """One state of the ramp: the targets, and the pressure difference, whose σ is of this level alone."""

    points: Points
    difference: Difference


def row_heights(mounting: Mounting, grid: Grid, levels: Sequence[RampLevel]) -> Estimate:
    """(L, R) heights of the inner face over the plane of symmetry, on the line that faces the cameras, mm.

    A parabola through the targets of a row that are near that line gives the height of its outer face there;
    NaN where fewer than three were seen. σ is that of the points.
    """
    rows = int(grid.row.max()) + 1
    near = [_near_crest(mounting, grid, level.points) for level in levels]
    each = [_of_level(mounting, grid, points, rows) for points in near]
    value, sigma = (np.array(part).reshape(len(levels), rows) for part in zip(*each, strict=True))
    return Estimate(value, sigma)


def _near_crest(mounting: Mounting, grid: Grid, points: Points) -> Points:
    return points.select(np.abs(mounting.targets.s_mm[grid.indices(points.target)]) < _CREST_MM)


def _of_level(mounting: Mounting, grid: Grid, points: Points, rows: int) -> tuple[Array, Array]:
    value, sigma = np.full(rows, np.nan), np.full(rows, np.nan)
    places = mounting.frame.places(points.xyz_mm)
    variance = mounting.frame.covariances(points.covariance_mm2)[:, 2, 2]
    row = grid.row[grid.indices(points.target)]
    for index in range(rows):
        of_row = row == index
        if of_row.sum() < _TERMS:
            continue
        design = np.vander(places[of_row, 1], _TERMS, increasing=True) / np.sqrt(variance[of_row, np.newaxis])
        covariance = np.linalg.pinv(design.T @ design)
        terms = covariance @ design.T @ (places[of_row, 2] / np.sqrt(variance[of_row]))
        value[index], sigma[index] = terms[0] - mounting.face_mm, np.sqrt(covariance[0, 0])
    return value, sigma
