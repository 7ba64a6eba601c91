"""Strain of the triangles and edges between targets, on the outer face: of what is seen, without a model.

The targets sit on the outer face, so bending counts: it stretches the face of a wall that is pressed flat by
as much as 10 %.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.grid import Grid
from grabberd.analysis.wall.strain import Strain, principal_stretches, strain
from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

Array = NDArray[np.float64]

_STEP_MM = 1e-5


class Places(NamedTuple):
    """Positions of the N targets of a grid in one state.

    Attributes:
        xyz_mm: (N, 3), NaN where a target was not measured.
        root_mm: (N, 3, K) square root of their joint covariance: cov[n, a, m, b] =
            Σ_k root[n, a, k] root[m, b, k]; K = 0 for given, not measured positions.
    """

    xyz_mm: Array
    root_mm: Array


class TriangleStrain(NamedTuple):
    """Strain of K triangles of targets.

    Attributes:
        triangle: (K,) indices of `Grid.triangles`; those with a target missing in either state are left out.
        strain: E, principal stretches and directions.
        stretch: (K, 2) principal stretches with σ.
        thickness: (K,) 1 / (λ1 λ2) with σ.
    """

    triangle: NDArray[np.intp]
    strain: Strain
    stretch: Estimate
    thickness: Estimate


class EdgeStrain(NamedTuple):
    """Strain of K edges, the sides between targets next to each other on the grid.

    Attributes:
        edge: (K, 2) indices of the targets; those missing in either state are left out.
        stretch: (K,) length relative to that in the reference state, with σ.
    """

    edge: NDArray[np.intp]
    stretch: Estimate


def outer_places(grid: Grid, points: Points) -> Places:
    """The targets of a field as measured."""
    where = grid.indices(points.target)
    xyz, root = np.full((len(grid), 3), np.nan), np.zeros((len(grid), 3, len(grid), 3))
    xyz[where] = points.xyz_mm
    root[where, :, where] = np.linalg.cholesky(points.covariance_mm2)
    return Places(xyz, root.reshape(len(grid), 3, -1))


def nominal_places(grid: Grid) -> Places:
    """The targets of the object model."""
    return Places(grid.nominal_mm, np.zeros((len(grid), 3, 0)))


def triangle_strain(grid: Grid, places: Places, reference: Places) -> TriangleStrain:
    """The strain of the triangles: F = [s1 s2][d1 d2]⁻¹, E = (FᵀF − 1)/2.

    Raises:
        AnalysisError: no triangle is whole in both.
    """
    chosen = _whole(grid.triangles, places, reference)
    corners = grid.triangles[chosen]
    present, before = places.xyz_mm[corners], reference.xyz_mm[corners]

    def values(now: Array, then: Array) -> Array:
        stretches = principal_stretches(_sides(now), _sides(then))
        return np.concatenate([stretches, 1 / stretches.prod(axis=-1, keepdims=True)], axis=-1)

    own = _variance(lambda now: values(now, before), present, places.root_mm[corners])
    other = _variance(lambda then: values(present, then), before, reference.root_mm[corners])
    result = strain(_sides(present), _sides(before))
    sigma = np.broadcast_to(np.sqrt(own + other), (len(chosen), 3))
    stretch = Estimate(result.stretch.values, sigma[:, :2])
    return TriangleStrain(chosen, result, stretch, Estimate(result.thickness, sigma[:, 2]))


def edge_strain(grid: Grid, places: Places, reference: Places) -> EdgeStrain:
    """The stretch of the edges.

    Raises:
        AnalysisError: no edge is whole in both.
    """
    pairs = grid.pairs()
    edges = pairs[_whole(pairs, places, reference)]
    lengths, variances = zip(*(_length(state, edges) for state in (places, reference)), strict=True)
    stretch = lengths[0] / lengths[1]
    sigma = stretch * np.sqrt(variances[0] / lengths[0] ** 2 + variances[1] / lengths[1] ** 2)
    return EdgeStrain(edges, Estimate(stretch, sigma))


def _length(places: Places, edges: NDArray[np.intp]) -> tuple[Array, Array]:
    """Lengths and their variances."""
    side = places.xyz_mm[edges[:, 1]] - places.xyz_mm[edges[:, 0]]
    length = np.linalg.norm(side, axis=1)
    unit = side / length[:, None]
    ends = places.root_mm[edges]
    along = np.einsum("ki,kim->km", unit, ends[:, 1] - ends[:, 0])
    return length, (along**2).sum(axis=1)


def _whole(parts: NDArray[np.intp], places: Places, reference: Places) -> NDArray[np.intp]:
    there = np.isfinite(np.linalg.norm(places.xyz_mm + reference.xyz_mm, axis=1))
    whole = np.flatnonzero(there[parts].all(axis=1))
    if not len(whole):
        raise AnalysisError(
            f"field and reference state share {there.sum()} targets, none of them next to each other",
            "choose a reference in which the targets of the field were measured too",
        )
    return whole


def _sides(corners: Array) -> Array:
    return corners[..., 1:, :] - corners[..., :1, :]


def _variance(function: Callable[[Array], Array], corners: Array, root: Array) -> Array:
    """(K, n) variances of a function of the corners (K, 3, 3) by their covariance's root; 0 if given."""
    if not root.shape[-1]:
        return np.zeros((1, 1))
    steps = _STEP_MM * np.eye(9).reshape(9, 1, 3, 3)
    slopes = (function(corners + steps) - function(corners - steps)) / (2 * _STEP_MM)
    spread = slopes.transpose(1, 2, 0) @ root.reshape(len(root), 9, -1)
    result: Array = (spread**2).sum(axis=-1)
    return result
