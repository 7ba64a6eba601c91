"""Strain of the triangles and edges between targets at one field, since the reference state."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis import (
    Estimate,
    Places,
    Surface,
    edge_strain,
    middle_places,
    nominal_middle_places,
    triangle_strain,
    wall_at,
)
from grabberd.errors import AnalysisError
from grabberd.processes.analysis.question import Question

Array = NDArray[np.float64]


class TargetStrains(NamedTuple):
    """Stretches of triangles of neighbouring targets, and of the edges between two; no more is kept.

    Attributes:
        triangle: (K,) indices of `Grid.triangles`; `triangle_stretch`: (K, 2) principal ones.
        edge: (E, 2) indices of the targets; `edge_stretch`: (E,).
    """

    triangle: NDArray[np.intp]
    triangle_stretch: Estimate
    edge: NDArray[np.intp]
    edge_stretch: Estimate


def target_strains(surface: Surface, question: Question) -> TargetStrains | None:
    """The strains; None without a reference state, or if no target is seen in both states."""
    if question.reference is None:
        return None
    grid, (depth_mm, reference) = question.grid, _reference(question)
    places = middle_places(grid, surface, depth_mm)
    try:
        triangles, edges = triangle_strain(grid, places, reference), edge_strain(grid, places, reference)
    except AnalysisError:
        return None
    return TargetStrains(triangles.triangle, triangles.stretch, edges.edge, edges.stretch)


@lru_cache(maxsize=4)
def _reference(question: Question) -> tuple[Array, Places]:
    """Depth (N,) below the targets' face at which strain is evaluated, and the reference state there."""
    grid, zones, then = question.grid, question.zones, question.reference
    # Half the wall if it is known, so that bending does not count as strain.
    depth_mm = wall_at(zones, grid.u_mm).depth_mm if zones else np.zeros(len(grid))
    if isinstance(then, Surface):
        return depth_mm, middle_places(grid, then, depth_mm)
    assert then is not None
    return depth_mm, nominal_middle_places(grid, then, depth_mm)
