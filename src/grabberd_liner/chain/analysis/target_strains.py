"""Strain of the triangles and edges between targets at one field, since the reference state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis import Estimate, edge_strain, outer_places, triangle_strain
from grabberd_liner.chain.analysis.question import Question


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


def target_strains(points: Points, question: Question) -> TargetStrains | None:
    """The strains; None without a reference state, or if no target is seen in both states."""
    if question.reference_places is None:
        return None
    grid, reference = question.grid, question.reference_places
    places = outer_places(grid, points)
    try:
        triangles, edges = triangle_strain(grid, places, reference), edge_strain(grid, places, reference)
    except AnalysisError:
        return None
    return TargetStrains(triangles.triangle, triangles.stretch, edges.edge, edges.stretch)
