"""Screening of points for impossible positions: ids that jumped, crossed targets, a folded wall."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.grid import Grid

_SHORTEST, _LONGEST = 0.7, 1.35
"""Fibres stretch by some ten per cent; when an id jumps to a neighbour, distances double or vanish."""

# Neighbouring normals more than a right angle apart.
_STEEPEST = 0.0


class Screening(NamedTuple):
    """Result of comparing points with their neighbours.

    Attributes:
        kept: (N,) True for points at possible distances from their neighbours.
        problems: one sentence for each kind of problem, with the targets.
    """

    kept: NDArray[np.bool_]
    problems: tuple[str, ...]


def screen(grid: Grid, place: NDArray[np.intp], xyz_mm: NDArray[np.float64]) -> Screening:
    """Leaves out points at impossible distances from their neighbours, the worst first; reports folds.

    Args:
        grid: the target grid.
        place: (N,) indices of the points in the grid.
        xyz_mm: (N, 3) points, object's frame.
    """
    where = np.full((len(grid), 3), np.nan)
    where[place] = xyz_mm
    pairs = grid.pairs()
    nominal_mm = _lengths(grid.nominal_mm, pairs)
    left_out: list[int] = []
    while (worst := _worst(where, pairs, nominal_mm)) is not None:
        left_out.append(worst)
        where[worst] = np.nan
    kept = np.isfinite(where[place, 0])
    return Screening(kept, (*_jumped(grid, left_out), *_folded(grid, where)))


def _worst(
    where: NDArray[np.float64], pairs: NDArray[np.intp], nominal_mm: NDArray[np.float64]
) -> int | None:
    """The target with most impossible distances, by their size if several have as many; None without any."""
    ratio = _lengths(where, pairs) / nominal_mm
    wrong = (ratio < _SHORTEST) | (ratio > _LONGEST)
    if not wrong.any():
        return None
    # The number of wrong distances decides; their size, scaled far below one, only breaks ties.
    at_odds = np.where(wrong, 1 + np.minimum(np.abs(np.log(np.maximum(ratio, 1e-3))), 100) / 1e3, 0.0)
    score = np.bincount(pairs.ravel(), np.repeat(at_odds, 2), len(where))
    return int(np.argmax(score))


def _lengths(xyz: NDArray[np.float64], pairs: NDArray[np.intp]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.linalg.norm(xyz[pairs[:, 1]] - xyz[pairs[:, 0]], axis=1)
    return lengths


def _jumped(grid: Grid, left_out: list[int]) -> tuple[str, ...]:
    if not left_out:
        return ()
    names = ", ".join(str(grid.target[index]) for index in sorted(left_out))
    return (
        f"left out, too far from or too near to their neighbours (ids jumped or crossed): targets {names}",
    )


def _folded(grid: Grid, where: NDArray[np.float64]) -> tuple[str, ...]:
    """Neighbouring triangles whose outsides face each other: the wall would be folded between them."""
    corner = where[grid.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    adjoining = grid.adjoining_triangles()
    facing = (normal[adjoining[:, 0]] * normal[adjoining[:, 1]]).sum(axis=1)
    folded = adjoining[facing < _STEEPEST]
    if not len(folded):
        return ()
    names = ", ".join(map(str, grid.target[np.unique(grid.triangles[folded])]))
    return (f"the wall is folded, or targets have crossed, among targets {names}",)
