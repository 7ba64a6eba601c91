"""The tube's mesh: triquadratic bricks over (angle, depth through the wall, length).

The block of bricks is flat in its own coordinates (θ, r, x), in which scikit-fem gives shape functions and
quadrature; the undeformed tube is a position of the nodes like any other. Nodes are numbered along x first,
so the stiffness is block tridiagonal in slabs of bricks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import (  # type: ignore[import-untyped]
    Basis,
    ElementHex2,
    FacetBasis,
    MeshHex,
)

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Three Gauss points a direction: exact for the products of a triquadratic brick's shape functions.
_ORDER = 5


@dataclass(frozen=True, slots=True, eq=False)
class Bricks:
    """Shape functions inside E bricks at Q points each.

    Attributes:
        nodes: (E, 27) node numbers.
        slopes: (E, Q, 27, 3) derivatives of the shape functions by (θ, r, x).
        weights: (E, Q) of the quadrature, in block coordinates.
        pressures: (E, Q, 4) functions of a brick's own pressure: 1 and the three local coordinates.
    """

    nodes: Indices
    slopes: Array
    weights: Array
    pressures: Array


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """Shape functions on a face of the tube, F facets at Q points each.

    Attributes:
        nodes: (F, 27) node numbers of the bricks behind the facets.
        shapes: (F, Q, 27) values; `by_theta`, `by_x`: their derivatives along the face.
        weights: (F, Q) of the quadrature, in block coordinates.
    """

    nodes: Indices
    shapes: Array
    by_theta: Array
    by_x: Array
    weights: Array


@dataclass(frozen=True, slots=True, eq=False)
class TubeMesh:
    """Block of bricks.

    Attributes:
        block: (N, 3) of the nodes: θ in rad, depth 0 (inner) to 1 (outer), x from 0 to 1.
        sections: number of node sections along x; each has `per_section` nodes.
    """

    block: Array
    sections: int
    per_section: int
    bricks: Bricks
    inner: Face
    outer: Face

    @classmethod
    def build(cls, angles: Array, layers: int, slabs: int) -> "TubeMesh":
        """Mesh with bricks between `angles` (rad), `layers` through the wall and `slabs` along the tube."""
        mesh = MeshHex.init_tensor(angles, np.linspace(0, 1, layers + 1), np.linspace(0, 1, slabs + 1))
        basis = Basis(mesh, ElementHex2(), intorder=_ORDER)
        where = basis.doflocs.T
        order = np.lexsort(np.round(where, 9).T)
        number = np.empty_like(order)
        number[order] = np.arange(len(order))
        sections = 2 * slabs + 1
        return cls(
            block=where[order],
            sections=sections,
            per_section=len(order) // sections,
            bricks=_bricks(basis, number),
            inner=_face(mesh, number, 0.0),
            outer=_face(mesh, number, 1.0),
        )

    def inner_angles(self) -> Array:
        """(F, Q) angles at the inner face's quadrature points."""
        angles: Array = self.inner.shapes @ self.block[self.inner.nodes, 0][..., np.newaxis]
        return angles[..., 0]


def _bricks(basis: Basis, number: Indices) -> Bricks:
    slopes = np.stack([np.moveaxis(function[0].grad, 0, -1) for function in basis.basis], axis=2)
    points = np.moveaxis(basis.mapping.F(basis.X), 0, -1)
    middle = basis.mesh.p[:, basis.mesh.t].mean(axis=1).T[:, np.newaxis]
    size = np.ptp(basis.mesh.p[:, basis.mesh.t], axis=1).T[:, np.newaxis]
    local = 2 * (points - middle) / size
    pressures = np.concatenate([np.ones_like(local[..., :1]), local], axis=-1)
    return Bricks(number[basis.element_dofs.T], slopes, basis.dx, pressures)


def _face(mesh: MeshHex, number: Indices, depth: float) -> Face:
    facets = mesh.facets_satisfying(lambda at: np.isclose(at[1], depth), boundaries_only=True)
    basis = FacetBasis(mesh, ElementHex2(), facets=facets, intorder=_ORDER)
    shapes = np.stack([np.asarray(function[0]) for function in basis.basis], axis=-1)
    slopes = np.stack([function[0].grad for function in basis.basis], axis=-1)
    return Face(number[basis.element_dofs.T], shapes, slopes[0], slopes[2], basis.dx)
