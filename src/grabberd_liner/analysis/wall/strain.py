"""Strain of the material between two states of the wall; rigid motion causes none.

The targets sit on the outer face, the membrane is the middle surface: bending alone strains the outer face by
as much as the effect sought (10 % for a liner of R 12.5 mm and wall 2.5 mm that is pressed flat). So tension
is computed from the strain of the middle surface.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.surface.jets import Jets
from grabberd_liner.analysis.wall.forms import Principal, inverse, outer_forms, symmetric_eigen

Array = NDArray[np.float64]


class Strain(NamedTuple):
    """Strain at some places.

    Attributes:
        green_lagrange: (..., 2, 2) E = (C − 1)/2 in the reference state's orthonormal basis, the first vector
            along the coordinate u (for triangles: along the first side), the second in the surface.
        stretch: principal stretches λ1 ≥ λ2 with their directions in the present state, object's frame.
        components: (..., 2, 2) of unit vectors along those of the reference state, by its two tangents.
    """

    green_lagrange: Array
    stretch: Principal
    components: Array

    @property
    def thickness(self) -> Array:
        """(...) stretch λ3 = 1 / (λ1 λ2) of the thickness, of a wall that keeps its volume."""
        result: Array = 1 / self.stretch.values.prod(axis=-1)
        return result


def strain(tangents: Array, reference_tangents: Array) -> Strain:
    """The strain that takes two tangent vectors of the material (..., 2, 3) from one state to another."""
    metric, before = (vectors @ np.swapaxes(vectors, -1, -2) for vectors in (tangents, reference_tangents))
    basis = _basis(before)
    lagrange = basis @ ((metric - before) / 2) @ np.swapaxes(basis, -1, -2)
    values, angle = symmetric_eigen(lagrange)
    stretches = np.sqrt(1 + 2 * values)
    cosine, sine = np.cos(angle), np.sin(angle)
    axes = np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
    components = axes @ basis
    return Strain(lagrange, Principal(stretches, components @ tangents / stretches[..., None]), components)


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
