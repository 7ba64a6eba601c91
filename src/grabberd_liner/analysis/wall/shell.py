"""Forces and stiffness of a thick wall, with its middle surface and its transverse shear as splines.

Each control point has four unknowns: the middle surface's position, and s, the part of the displacement
along the normal that is shear alone. The normals of the sheared wall stand on the surface x − s n, so bending
is measured by b + ∇∇s and shear by ∇s (Timoshenko's beam, on a surface). The parameters round and along are
lengths on the mounted wall in mm, so second derivatives of s need no connection.

Arrays "by derivatives and unknowns" hold, at each point, what belongs to the value and the five derivatives
of x, y, z, s in the order of `DERIVATIVES`; the forms depend on the five derivatives alone.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.kernel import KERNEL, Kernel
from grabberd_liner.analysis.wall.rubber import Forms, Invariants, RubberWall, complex_step
from grabberd_liner.analysis.wall.splines import DERIVATIVES, Basis

SHEAR_SHARE = 5 / 6
"""Of the thickness that resists shear: its stress is a parabola that vanishes at the faces."""
UNKNOWNS = 4
"""Of a control point: x, y, z, s."""
_COMPONENTS = ((0, 0), (1, 1), (0, 1))
"""Directions, round and along, of a form's three components."""
_PARTS = (len(DERIVATIVES), UNKNOWNS)
_SIZE = len(DERIVATIVES) * UNKNOWNS
UNIT_LOADS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """The middle surface at N points.

    Attributes:
        tangents: (2, N, 3) derivatives round and along.
        second: (3, N, 3) second derivatives 11, 22, 12.
        dual: (2, N, 3) dual tangents, in the surface.
        normal: (N, 3) unit normal, outward.
        area: (N,) area per area of the parameters.
        slope: (2, N) derivatives of the shear s.
        slope_second: (3, N) its second derivatives.
    """

    tangents: Array
    second: Array
    dual: Array
    normal: Array
    area: Array
    slope: Array
    slope_second: Array

    @classmethod
    def of(cls, basis: Basis, control: Array) -> "Geometry":
        """Geometry of control values (K, 4): x, y, z, s."""
        return cls.at(basis.derivatives(control))

    @classmethod
    def at(cls, values: Array) -> "Geometry":
        """Geometry of the five derivatives (5, N, 4) of x, y, z, s."""
        tangents, second = values[:2, :, :3], values[2:, :, :3]
        across = _cross(tangents[1], tangents[0])
        area = np.sqrt(_dot(across, across))
        normal = across / area[:, np.newaxis]
        # a¹ = n × a₂ / area and a² = a₁ × n / area, because a₂ × a₁ = area · n.
        dual = np.stack([_cross(normal, tangents[1]), _cross(tangents[0], normal)])
        dual /= area[:, np.newaxis]
        return cls(tangents, second, dual, normal, area, values[:2, :, 3], values[2:, :, 3])

    def forms(self) -> Forms:
        """Metric, and the curvature that bends the wall: of the sheared normals."""
        metric = np.stack([_dot(self.tangents[i], self.tangents[j]) for i, j in _COMPONENTS])
        curvature = self.slope_second - _dot(self.normal, self.second)
        return Forms(metric, curvature)

    def director(self) -> Array:
        """(N, 3) unit normal of the sheared wall, to first order in the shear."""
        return self.normal + np.einsum("an,ani->ni", self.slope, self.dual)

    def forms_by_values(self) -> Array:
        """(6, N, 5, 4) derivatives of the forms by the five derivatives of x, y, z, s."""
        by = np.zeros((6, len(self.area), 5, UNKNOWNS))
        for index, (i, j) in enumerate(_COMPONENTS):
            by[index, :, i, :3] += self.tangents[j]
            by[index, :, j, :3] += self.tangents[i]
            christoffel = np.einsum("lni,ni->ln", self.dual, self.second[index])
            by[3 + index, :, :2, :3] = np.einsum("ln,ni->nli", christoffel, self.normal)
            by[3 + index, :, 2 + index, :3] = -self.normal
            by[3 + index, :, 2 + index, 3] = 1.0
        return by

    def normal_by_tangents(self) -> Array:
        """(N, 3, 2, 3) derivatives of the normal by the tangents."""
        return -np.einsum("lni,nj->nilj", self.dual, self.normal)


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """Load on the wall at its N points of quadrature.

    Attributes:
        difference_mpa: pressure on the outer face over the gas inside.
        contact_mpa: (N,) pressure on the inner face over that gas.
        traction_mpa: (2, N) tangential traction on the inner face, round and along.
    """

    difference_mpa: float
    contact_mpa: Array
    traction_mpa: Array

    def by_units(self) -> Array:
        """(N, 4) pressure difference, contact pressure and both tractions."""
        difference = np.full(len(self.contact_mpa), self.difference_mpa)
        return np.column_stack([difference, self.contact_mpa, *self.traction_mpa])


class Work(NamedTuple):
    """Work at N points of a wall, by derivatives and unknowns, per area of the parameters.

    Attributes:
        resistance: (N, 6, 4) of the wall's stress.
        units: (N, 6, 4, 4) of a pressure difference, a contact pressure and both tractions of 1 MPa.
    """

    resistance: Array
    units: Array

    def unbalanced(self, load: Load) -> Array:
        """(N, 6, 4) work of a load less that of the stress."""
        loaded = self.units.reshape(-1, _SIZE, UNIT_LOADS) @ load.by_units()[..., np.newaxis]
        return loaded.reshape(self.resistance.shape) - self.resistance


class Shell:
    """The wall, discretised."""

    def __init__(
        self, basis: Basis, weights_mm2: Array, wall: RubberWall, kernel: Kernel | None = KERNEL
    ) -> None:
        """Takes the wall at its points of quadrature.

        Args:
            basis: splines there.
            weights_mm2: (N,) of the quadrature, in the area of the parameters.
            wall: its rubber there.
            kernel: what computes it; None for numpy.
        """
        self.basis, self.weights, self.wall = basis, weights_mm2, wall
        self._kernel = kernel
        self._rest = np.concatenate([*wall.unstressed, wall.thickness_mm[np.newaxis]])

    @property
    def _shear(self) -> Array:
        """(N,) stiffness against shear per area of the parameters, N/mm.

        Normals of stretched rubber tilt more easily, by the square of its thinning. The parameters are
        lengths on the mounted wall, so mounting thins it by the wall's `area`; later thinning is left out.
        """
        # The slope is small, and its metric nearly that of the parameters.
        return SHEAR_SHARE * self.wall.shear_mpa * self.wall.thickness_mm * self.wall.area**3

    def force(self, control: Array, load: Load) -> Array:
        """(K, 4) out-of-balance force, load less resistance, N."""
        return self.gathered(self.work(control).unbalanced(load)[..., np.newaxis])[..., 0]

    def work(self, control: Array) -> Work:
        """Work of stress and of unit loads."""
        if self._kernel is None:
            return self._work(Geometry.of(self.basis, control))
        count = len(self.weights)
        work = Work(np.empty((count, *_PARTS)), np.empty((count, *_PARTS, UNIT_LOADS)))
        self._kernel.wall_forces(self.basis.derivatives(control), self._rest, self.wall.shear_mpa, *work)
        return work

    def _work(self, geometry: Geometry) -> Work:
        forms, by_values = geometry.forms(), geometry.forms_by_values()
        stress = self.wall.area * self.wall.resultants(forms)
        inner = self.wall.layer(forms, -0.5)
        face = geometry.area * inner_area(forms, inner.depth_mm)
        resistance, units = np.zeros((len(face), *_PARTS)), np.zeros((len(face), *_PARTS, UNIT_LOADS))
        resistance[:, 1:] = np.einsum("en,endc->ndc", stress, by_values)
        resistance[:, 1:3, 3] += (self._shear * geometry.slope).T
        # Incompressible, so a pressure on the outer face works like one on the middle surface.
        units[:, 0, :3, 0] = -geometry.area[:, np.newaxis] * geometry.normal
        units[:, 0, :3, 1] = face[:, np.newaxis] * geometry.normal
        units[:, 1:, :, 1] = np.einsum("en,endc->ndc", face * inner.by_forms, by_values)
        traction = face[:, np.newaxis] * _directions(geometry)
        units[:, 0, :3, 2:] = traction.transpose(1, 2, 0)
        # A traction on the inner face has an arm: it turns the sheared wall's normal as well.
        turning = traction * inner.depth_mm[:, np.newaxis]
        units[:, 1:3, :3, 2:] = np.einsum("ani,nilj->nlja", turning, geometry.normal_by_tangents())
        units[:, 1:3, 3, 2:] = np.einsum("ani,lni->nla", turning, geometry.dual)
        return Work(resistance, units)

    def gathered(self, work: Array) -> Array:
        """(K, 4, C) sums over the wall of work (N, 6, 4, C) at its points."""
        weighted = work * self.weights[:, np.newaxis, np.newaxis, np.newaxis]
        each = np.einsum("dni,ndcm->nicm", self.basis.values, weighted, optimize=True)
        members = self.basis.members.ravel()
        flat = each.reshape(len(members), -1)
        count = int(members.max()) + 1
        sums = np.stack([np.bincount(members, column, count) for column in flat.T], axis=1)
        return np.asarray(sums, np.float64).reshape(count, UNKNOWNS, -1)

    def stiffness(self, control: Array, load: Load) -> Array:
        """(N, 24, 24) derivatives of resistance less load, by derivatives and unknowns.

        How a traction turns with the wall is left out: it is of the order of traction over stiffness.
        """
        if self._kernel is None:
            return self._stiffness(Geometry.of(self.basis, control), load)
        stiffness = np.empty((len(self.weights), _SIZE, _SIZE))
        self._kernel.wall_stiffness(
            self.basis.derivatives(control),
            self._rest,
            self.wall.shear_mpa,
            load.difference_mpa,
            np.ascontiguousarray(load.contact_mpa),
            stiffness,
        )
        return stiffness

    def _stiffness(self, geometry: Geometry, load: Load) -> Array:
        stress = self.wall.area * self.wall.resultants(geometry.forms())
        six = np.concatenate(geometry.forms())
        pressing = self._pressing(six, load.contact_mpa)
        pressing_by = complex_step(lambda stepped: self._pressing(stepped, load.contact_mpa), six)
        by_values = geometry.forms_by_values()
        material = self.wall.area * self.wall.stiffness(geometry.forms()) - pressing_by[1:]
        matrix = np.zeros((len(self.weights), *_PARTS, *_PARTS))
        matrix[:, 1:, :, 1:] = _sandwiched(by_values, material)
        _add_curving(matrix[:, 1:, :3, 1:, :3], geometry, stress - pressing[1:])
        for first in (1, 2):
            matrix[:, first, 3, first, 3] += self._shear
        _subtract_push(matrix[:, 0, :3], geometry, pressing[0] - load.difference_mpa)
        growing = np.einsum("fn,fnlc->nlc", geometry.area * pressing_by[0], by_values)
        matrix[:, 0, :3, 1:] -= np.einsum("ni,nlc->nilc", geometry.normal, growing)
        return matrix.reshape(-1, _SIZE, _SIZE)

    def _pressing(self, six: Array, contact_mpa: Array) -> Array:
        """(7, N) effect of a contact pressure at forms (6, N).

        The first row is the push per area of the middle surface; the others are its stress on the forms, per
        area of the parameters, because the inner face moves with them.
        """
        forms = Forms(six[:3], six[3:])
        inner = self.wall.layer(forms, -0.5)
        push = contact_mpa * inner_area(forms, inner.depth_mm)
        area = np.sqrt(Invariants.of(forms).determinant)
        return np.concatenate([push[np.newaxis], area * push * inner.by_forms])


def inner_area(forms: Forms, depth_mm: Array) -> Array:
    """(N,) area of the layer at a depth per area of the middle surface."""
    return Invariants.of(forms).area(depth_mm)


def _directions(geometry: Geometry) -> Array:
    """(2, N, 3) unit vectors in the surface, round the wall and across that."""
    first = geometry.tangents[0] / np.linalg.norm(geometry.tangents[0], axis=1, keepdims=True)
    return np.stack([first, _cross(first, geometry.normal)])


def _sandwiched(by_values: Array, material: Array) -> Array:
    """(N, 5, 4, 5, 4) Bᵀ C B of the forms' derivatives (6, N, 5, 4) and a stiffness (6, 6, N)."""
    count = by_values.shape[1]
    flat = by_values.reshape(6, count, -1)
    bent = np.einsum("efn,fnc->enc", material, flat)
    product: Array = np.einsum("end,enc->ndc", flat, bent, optimize=True)
    return product.reshape(count, *by_values.shape[2:], *by_values.shape[2:])


def _add_curving(matrix: Array, geometry: Geometry, stress: Array) -> None:
    """Adds stress (6, N) times second derivatives of the forms by those of x, y, z to a (N, 5, 3, 5, 3)."""
    n11, n22, n12 = stress[:3]
    membrane = np.array([[2 * n11, n12], [n12, 2 * n22]])
    matrix[:, :2, :, :2] += np.einsum("lmn,ij->nlimj", membrane, np.eye(3))
    # With u_l = n · δx,l the normal turns by δn = −Σ u_l aˡ and shortens by half of δn² along itself, so
    # δ²b = 2 Σ u_l (aˡ · δx,αβ) − 2 Σ u_m (aˡ · x,αβ) (aᵐ · δx,l) + (n · x,αβ) Σ u_l u_m aˡ · aᵐ.
    moment, normal, dual = stress[3:], geometry.normal, geometry.dual
    turned = np.einsum("en,ni,lnj->nliej", moment, normal, dual)
    matrix[:, :2, :, 2:] += turned
    matrix[:, 2:, :, :2] += turned.transpose(0, 3, 4, 1, 2)
    curved = np.einsum("en,eni->ni", moment, geometry.second)
    sliding = np.einsum("lnk,nk,ni,mnj->nmilj", dual, curved, normal, dual, optimize=True)
    matrix[:, :2, :, :2] -= sliding + sliding.transpose(0, 3, 4, 1, 2)
    along = _dot(normal, curved) * np.einsum("lni,mni->lmn", dual, dual)
    matrix[:, :2, :, :2] += np.einsum("lmn,ni,nj->nlimj", along, normal, normal, optimize=True)


def _subtract_push(matrix: Array, geometry: Geometry, push_mpa: Array) -> None:
    """Subtracts from (N, 3, 6, 4) how a push turns and grows with the tangents, as a₂ × a₁ does."""
    push = push_mpa[:, np.newaxis, np.newaxis]
    matrix[:, :, 1, :3] -= push * _crossing(geometry.tangents[1])
    matrix[:, :, 2, :3] += push * _crossing(geometry.tangents[0])


def _crossing(vectors: Array) -> Array:
    """(N, 3, 3) matrices of v × ·."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _cross(one: Array, other: Array) -> Array:
    """(N, 3) products: several times faster than numpy's, which takes any shape."""
    (a, b, c), (d, e, f) = one.T, other.T
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=1)


def _dot(one: Array, other: Array) -> Array:
    return np.einsum("...i,...i->...", one, other)
