"""Strain of the triangles and edges between targets, on the outer face: of what is seen, without a model.

The targets sit on the outer face, so bending counts: it stretches the face of a wall that is pressed flat by
as much as 10 %.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.wall.strain import Strain, strain

Array = NDArray[np.float64]


class Places(NamedTuple):
    """Positions of the N targets of a grid in one state.

    Attributes:
        xyz_mm: (N, 3), NaN where a target was not measured.
        covariance_mm2: (N, 3, 3) of each, independent of the others; 0 for given, not measured positions.
    """

    xyz_mm: Array
    covariance_mm2: Array


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
    xyz, covariance = np.full((len(grid), 3), np.nan), np.zeros((len(grid), 3, 3))
    xyz[where], covariance[where] = points.xyz_mm, points.covariance_mm2
    return Places(xyz, covariance)


def nominal_places(grid: Grid) -> Places:
    """The targets of the object model."""
    return Places(grid.nominal_mm, np.zeros((len(grid), 3, 3)))


def triangle_strain(grid: Grid, places: Places, reference: Places) -> TriangleStrain:
    """The strain of the triangles: F = [s1 s2][d1 d2]⁻¹, E = (FᵀF − 1)/2.

    Raises:
        AnalysisError: no triangle is whole in both.
    """
    chosen = _whole(grid.triangles, places, reference)
    corners = grid.triangles[chosen]
    now, then = _sides(places.xyz_mm[corners]), _sides(reference.xyz_mm[corners])
    result = strain(now, then)
    stretches, shares = result.stretch.values, result.components
    # A unit vector along a principal direction is Σ c d of the sides d before, and λ n = Σ c s of those now.
    own = shares[..., np.newaxis] * result.stretch.directions[:, :, np.newaxis]
    other = -(stretches[..., np.newaxis] * shares)[..., np.newaxis] * (shares @ then)[:, :, np.newaxis]
    variance = _variance(own, stretches, places.covariance_mm2[corners])
    variance = variance + _variance(other, stretches, reference.covariance_mm2[corners])
    sigma = np.sqrt(variance)
    return TriangleStrain(
        chosen, result, Estimate(stretches, sigma[:, :2]), Estimate(result.thickness, sigma[:, 2])
    )


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
    ends = places.covariance_mm2[edges].sum(axis=1)
    return length, ((ends @ unit[..., np.newaxis])[..., 0] * unit).sum(axis=1)


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


def _variance(by_sides: Array, stretches: Array, covariance_mm2: Array) -> Array:
    """(K, 3) variances of both stretches and of the thickness.

    Args:
        by_sides: (K, 2, 2, 3) derivatives of the stretches (K, 2) by the sides.
        stretches: (K, 2) themselves.
        covariance_mm2: (K, 3, 3, 3) of each corner.
    """
    thinned = -(by_sides / stretches[..., np.newaxis, np.newaxis]).sum(axis=1, keepdims=True)
    slopes = np.concatenate([by_sides, thinned / stretches.prod(axis=1)[:, None, None, None]], axis=1)
    by_corners = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
    apart = by_corners.transpose(0, 2, 1, 3)  # [triangle, corner, quantity, axis]
    variance: Array = ((apart @ covariance_mm2) * apart).sum(axis=(1, 3))
    return variance
