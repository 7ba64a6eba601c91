"""Fundamental forms of the wall's outer face and of its middle surface, from jets, and the strain between
two states.

Tensors are (..., 2, 2) components in the material coordinates (u, v), in mm. The normal points outward, out
of the liner, and a curvature is positive if its centre lies inside: a cylinder of outer radius R has 1/R on
its outer face and 1/(R − h) at the depth h. Bending alone strains the outer face, where the targets sit, by
as much as the effect sought (10 % if a liner of R 12.5 mm and wall 2.5 mm is pressed flat), so tension comes
from the middle surface. Strain of triangles and edges between targets needs no model.
"""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import Jets, index


class Forms(NamedTuple):
    """First and second fundamental form of a surface at some places.

    Attributes:
        tangents: (..., 2, 3) ∂X/∂u and ∂X/∂v, in the object's frame.
        normal: (..., 3) unit normal, outward, in the object's frame.
        first: (..., 2, 2) covariant components.
        second_per_mm: (..., 2, 2) covariant components, 1/mm.
    """

    tangents: Array
    normal: Array
    first: Array
    second_per_mm: Array


def outer_forms(jets: Jets, outward: float = 1.0) -> Forms:
    """The forms of the face that the jets belong to.

    Args:
        jets: (..., 15, 3).
        outward: 1.0 where X_u × X_v points outward, −1.0 where inward (`Grid.outward`).
    """
    tangents = jets[..., [index(1, 0), index(0, 1)], :]
    normal = outward * np.cross(tangents[..., 0, :], tangents[..., 1, :])
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    seconds = jets[..., [index(2, 0), index(1, 1), index(1, 1), index(0, 2)], :]
    second = -(seconds @ normal[..., None])[..., 0]
    first = tangents @ np.swapaxes(tangents, -1, -2)
    return Forms(tangents, normal, first, second.reshape(first.shape))


def middle_forms(jets: Jets, depth_mm: float | Array, outward: float = 1.0) -> Forms:
    """The forms of the parallel surface at a depth below the face: I − 2h II + h² III and II − h III.

    Exact: a parallel surface shares the face's normals, so nothing has to be fitted again.

    Args:
        jets: (..., 15, 3) of the outer (target) face.
        depth_mm: (...) from the face inward; half the wall and the target's thickness for the middle surface.
        outward: as in `outer_forms`.
    """
    outer = outer_forms(jets, outward)
    depth = np.asarray(depth_mm, np.float64)[..., None, None]
    curvature = mixed(outer.first, outer.second_per_mm)
    third = outer.second_per_mm @ curvature
    return Forms(
        tangents=outer.tangents - depth * np.swapaxes(curvature, -1, -2) @ outer.tangents,
        normal=outer.normal,
        first=outer.first - 2 * depth * outer.second_per_mm + depth**2 * third,
        second_per_mm=outer.second_per_mm - depth * third,
    )


def inverse(tensor: Array) -> Array:
    """The inverses of 2 × 2 matrices (..., 2, 2)."""
    a, b, c, d = (tensor[..., i, j] for i in (0, 1) for j in (0, 1))
    adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
    return adjugate / determinant(tensor)[..., None, None]


def determinant(tensor: Array) -> Array:
    """(...) the determinants of 2 × 2 matrices (..., 2, 2)."""
    return tensor[..., 0, 0] * tensor[..., 1, 1] - tensor[..., 0, 1] * tensor[..., 1, 0]


def trace(tensor: Array) -> Array:
    """(...) the traces of 2 × 2 matrices (..., 2, 2)."""
    return tensor[..., 0, 0] + tensor[..., 1, 1]


def mixed(first: Array, covariant: Array) -> Array:
    """(..., 2, 2) the mixed components g^αγ B_γβ of a tensor."""
    return inverse(first) @ covariant


def principal_values(mixed_components: Array) -> Array:
    """(..., 2) the principal values, the greater first, of a tensor given by its mixed components."""
    middle = trace(mixed_components) / 2
    half = (mixed_components[..., 0, 0] - mixed_components[..., 1, 1]) / 2
    square = half**2 + mixed_components[..., 0, 1] * mixed_components[..., 1, 0]
    radius = np.sqrt(np.maximum(square, 0.0))
    return np.stack([middle + radius, middle - radius], axis=-1)


def curvature_per_m(forms: Forms) -> Array:
    """(..., 2) principal curvatures κ1 ≥ κ2 in 1/m, positive with the centre inside."""
    return principal_values(1e3 * mixed(forms.first, forms.second_per_mm))


class Strain(NamedTuple):
    """Strain at some places.

    Attributes:
        green_lagrange: (..., 2, 2) E = (C − 1)/2 in the reference state's orthonormal basis, the first vector
            along the coordinate u (for triangles: along the first side), the second in the surface.
        stretch: (..., 2) principal ones, λ1 ≥ λ2.
        directions: (..., 2, 3) unit vectors along them in the present state, in the object's frame.
        components: (..., 2, 2) of unit vectors along those of the reference state, by its two tangents.
    """

    green_lagrange: Array
    stretch: Array
    directions: Array
    components: Array


def strain(tangents: Array, reference_tangents: Array) -> Strain:
    """The strain that takes two tangent vectors of the material (..., 2, 3) from one state to another."""
    metric, before = (vectors @ np.swapaxes(vectors, -1, -2) for vectors in (tangents, reference_tangents))
    basis = _basis(before)
    lagrange = basis @ ((metric - before) / 2) @ np.swapaxes(basis, -1, -2)
    middle = trace(lagrange) / 2
    half = (lagrange[..., 0, 0] - lagrange[..., 1, 1]) / 2
    off = (lagrange[..., 0, 1] + lagrange[..., 1, 0]) / 2
    radius, angle = np.hypot(half, off), np.arctan2(off, half) / 2
    stretches = np.sqrt(1 + 2 * np.stack([middle + radius, middle - radius], axis=-1))
    cosine, sine = np.cos(angle), np.sin(angle)
    axes = np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
    components = axes @ basis
    return Strain(lagrange, stretches, components @ tangents / stretches[..., None], components)


def outer_strain(jets: Jets, reference_jets: Jets) -> Strain:
    """The strain of the outer face, bending included: that of the targets, not of the membrane."""
    return strain(outer_forms(jets).tangents, outer_forms(reference_jets).tangents)


def _basis(metric: Array) -> Array:
    """(..., 2, 2) rows: the components of an orthonormal basis, the first vector along the first tangent."""
    along = np.sqrt(metric[..., 0, 0])
    skew = metric[..., 0, 1] / along
    across = np.sqrt(metric[..., 1, 1] - skew**2)
    zero = np.zeros_like(along)
    return inverse(np.stack([np.stack([along, zero], axis=-1), np.stack([skew, across], axis=-1)], axis=-2))


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
        stretch: (K, 2) principal stretches with σ.
    """

    triangle: Indices
    stretch: Estimate


class EdgeStrain(NamedTuple):
    """Strain of K edges, the sides between targets next to each other on the grid.

    Attributes:
        edge: (K, 2) indices of the targets; those missing in either state are left out.
        stretch: (K,) length relative to that in the reference state, with σ.
    """

    edge: Indices
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
    stretches, shares = result.stretch, result.components
    # A unit vector along a principal direction is Σ c d of the sides d before, and λ n = Σ c s of those now.
    own = shares[..., np.newaxis] * result.directions[:, :, np.newaxis]
    other = -(stretches[..., np.newaxis] * shares)[..., np.newaxis] * (shares @ then)[:, :, np.newaxis]
    variance = _variance(own, places.covariance_mm2[corners])
    variance = variance + _variance(other, reference.covariance_mm2[corners])
    return TriangleStrain(chosen, Estimate(stretches, np.sqrt(variance)))


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


def _length(places: Places, edges: Indices) -> tuple[Array, Array]:
    """Lengths and their variances."""
    side = places.xyz_mm[edges[:, 1]] - places.xyz_mm[edges[:, 0]]
    length = np.linalg.norm(side, axis=1)
    unit = side / length[:, None]
    ends = places.covariance_mm2[edges].sum(axis=1)
    return length, ((ends @ unit[..., np.newaxis])[..., 0] * unit).sum(axis=1)


def _whole(parts: Indices, places: Places, reference: Places) -> Indices:
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


def _variance(by_sides: Array, covariance_mm2: Array) -> Array:
    """(K, 2) variances of both stretches.

    Args:
        by_sides: (K, 2, 2, 3) derivatives of the stretches by the sides.
        covariance_mm2: (K, 3, 3, 3) of each corner.
    """
    by_corners = np.concatenate([-by_sides.sum(axis=2, keepdims=True), by_sides], axis=2)
    apart = by_corners.transpose(0, 2, 1, 3)  # [triangle, corner, stretch, axis]
    return ((apart @ covariance_mm2) * apart).sum(axis=(1, 3))
