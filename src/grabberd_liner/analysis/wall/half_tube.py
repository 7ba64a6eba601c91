"""The half of a mounted liner that faces the cameras, as a thick wall between its clamped ends and its cuts.

The liner's frame: x along the tube, z towards the cameras, an angle θ round it from z towards y, so the open
wall lies at (x, R sin θ, R cos θ); the parameters of the surface are s = R θ and x, in mm. The cuts are at θ
= ±90°. Three functions along each describe the effect of the hidden half: its shift towards the cameras (z),
its turn about the tube's axis, and the force across the wall there (y); if all are zero, the hidden half is
the mirror image. A patch is an interval round times one along; its matrices are one product over its points
of quadrature and the derivatives there.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from grabberd.core.arrays import Array, Indices, Mask
from grabberd_liner.analysis.wall.material import neo_hookean_stretch
from grabberd_liner.analysis.wall.rubber import NEAR, Factors, Rows, RubberWall
from grabberd_liner.analysis.wall.shell import UNKNOWNS, Geometry, Load, Shell
from grabberd_liner.analysis.wall.splines import (
    DEGREE,
    DERIVATIVES,
    GAUSS_ALONG,
    GAUSS_ROUND,
    Basis,
    SplineAxis,
    SplineGrid,
)

_X, _Y, _Z, _SHEAR = range(UNKNOWNS)


@dataclass(frozen=True, slots=True, eq=False)
class Cuts:
    """Constraints of the half tube, with K control points of four values.

    Attributes:
        order: (K, 4) number of the unknown that each control value follows; −1 for a held one.
        count: number n of unknowns.
        free: (4 K, n) control values by the unknowns.
        moved: (4 K, 4 A) control values by the A control values of the shift of the cut at low θ, of that at
            high θ (mm), and of the two cuts' turns dy/ds (rad).
        forced: (n, 2 A) force on the unknowns by the control values of the force on the cuts along y per
            length of tube, low θ then high, N/mm; each counts as if it were constant over its spline.
    """

    order: Indices
    count: int
    free: sparse.csr_matrix
    moved: sparse.csr_matrix
    forced: sparse.csr_matrix

    @classmethod
    def of(cls, grid: SplineGrid) -> "Cuts":
        """Constraints on a grid."""
        around, along = grid.around.count, grid.along.count
        number = np.arange(grid.count * UNKNOWNS).reshape(along, around, UNKNOWNS)
        order, count = _ordered(_followed(number), _held(number))
        rows = np.flatnonzero(order >= 0)
        free = sparse.csr_matrix((np.ones(len(rows)), (rows, order[rows])), shape=(number.size, count))
        moved, forced = _moved(grid, number), free.T @ _forced(grid, number)
        return cls(order.reshape(grid.count, UNKNOWNS), count, free, moved, forced)


def _held(number: Indices) -> Mask:
    """True for control values that are held: z on a cut, and the clamped ends.

    An end's own control values are held, and those beside it in all but x, so that the wall leaves it at the
    mounted slope.
    """
    held = np.zeros(number.shape, bool)
    held[:, [0, -1], _Z] = True
    held[[0, -1]] = True
    held[[1, -2], :, 1:] = True
    return held.ravel()


def _followed(number: Indices) -> Indices:
    """(4 K,) control value that each one follows.

    On a cut, x, y and s follow those beside it, so that they have no slope there.
    """
    followed = number.copy()
    for axis in (_X, _Y, _SHEAR):
        followed[:, 0, axis] = number[:, 1, axis]
        followed[:, -1, axis] = number[:, -2, axis]
    return followed.ravel()


def _ordered(followed: Indices, held: Mask) -> tuple[Indices, int]:
    """Number of each control value's unknown, (4 K,), −1 for a held one; and the number of unknowns."""
    kept = np.unique(followed[~held & ~held[followed]])
    order = np.full(len(followed), -1, dtype=np.intp)
    order[kept] = np.arange(len(kept))
    return np.where(held, -1, order[followed]), len(kept)


def cut_points(grid: SplineGrid) -> Indices:
    """(A,) numbers along the tube of the control points that may move on a cut: all but the clamped ends'."""
    return np.arange(2, grid.along.count - 2)


def _moved(grid: SplineGrid, number: Indices) -> sparse.csr_matrix:
    inner = cut_points(grid)
    step_mm = grid.around.greville[1] - grid.around.greville[0]
    size = len(inner)
    # The slope at a spline's end is that between its last two control points.
    parts = [(0, _Z, 1.0), (-1, _Z, 1.0), (0, _Y, -step_mm), (-1, _Y, step_mm)]
    rows = np.concatenate([number[inner, side, axis] for side, axis, _ in parts])
    values = np.repeat([value for _, _, value in parts], size)
    shape = (number.size, len(parts) * size)
    return sparse.csr_matrix((values, (rows, np.arange(len(rows)))), shape=shape)


def _forced(grid: SplineGrid, number: Indices) -> sparse.csr_matrix:
    inner = cut_points(grid)
    knots = grid.along.knots
    # A spline's integral is its span of knots over its order.
    integral_mm = (knots[DEGREE + 1 :] - knots[: -DEGREE - 1])[inner] / (DEGREE + 1)
    rows = np.concatenate([number[inner, 0, _Y], number[inner, -1, _Y]])
    shape = (number.size, len(rows))
    return sparse.csr_matrix((np.tile(integral_mm, 2), (rows, np.arange(len(rows)))), shape=shape)


ARCS, SLABS = 16, 26
"""Intervals round the half and along it.

Twice as many arcs move contact pressures by less than .2 kPa; along the tube the rim of a teat asks for
intervals shorter than the targets' pitch.
"""
_POINTS = GAUSS_ROUND * GAUSS_ALONG
_DERIVATIVES = len(DERIVATIVES)
_MEMBERS = (DEGREE + 1) ** 2
_PATCH = _MEMBERS * UNKNOWNS
"""Control values that matter on one patch."""


@dataclass(frozen=True, slots=True)
class MountedTube:
    """The liner as mounted, open and without a teat.

    Attributes:
        radius_mm: of the wall's middle, halfway along.
        taper: growth of the radius per length towards low x.
        length_mm: between the ends that hold it; x runs from minus half to plus half of it.
        thickness_mm: of the mounted wall.
        young_mpa: Young's modulus at small strain.
        pretension_n: axial force of the mounted liner.
    """

    radius_mm: float
    taper: float
    length_mm: float
    thickness_mm: float
    young_mpa: float
    pretension_n: float

    @property
    def stretch(self) -> float:
        """λ, length of the mounted tube over that of the loose one.

        Neo-Hookean: F₀ = µ (λ² − 1/λ) A, where A is the mounted section.
        """
        section_mm2 = 2 * np.pi * self.radius_mm * self.thickness_mm
        return neo_hookean_stretch(3 * self.pretension_n / (self.young_mpa * section_mm2))

    def changed(self, young: float, thickness: float, pretension: float) -> "MountedTube":
        """The tube with its modulus, thickness and pretension times e to the given powers."""
        return replace(
            self,
            young_mpa=self.young_mpa * np.exp(young),
            thickness_mm=self.thickness_mm * np.exp(thickness),
            pretension_n=self.pretension_n * np.exp(pretension),
        )


class Tangent:
    """Derivative of the wall's resistance less its load by its unknowns.

    Attributes:
        factors: of it.
    """

    def __init__(self, factors: Factors, edges: Array, members: Indices, order: Indices) -> None:
        """Keeps what can tell how held values act.

        Args:
            factors: of the matrix by the unknowns.
            edges: (P, 64, 64) matrices of the patches beside a cut.
            members: (P, 16) their control points.
            order: (K, 4) as in `Cuts`.
        """
        self.factors = factors
        self._edges, self._members, self._order = edges, members, order

    def by_held(self, columns: sparse.csr_matrix) -> Array:
        """(n, M) derivative by parameters that move values on the cuts, `columns` (4 K, M) of them."""
        values = self._members[:, :, np.newaxis] * UNKNOWNS + np.arange(UNKNOWNS)
        product = self._edges @ columns.toarray()[values.reshape(-1, _PATCH)]
        unknowns = self._order[self._members].ravel()
        free = np.flatnonzero(unknowns >= 0)
        shape = (self._order.max() + 1, len(unknowns))
        sums = sparse.csr_matrix((np.ones(len(free)), (unknowns[free], free)), shape=shape)
        return sums @ product.reshape(len(unknowns), -1)


class HalfTube:
    """Mesh and equations of the half tube.

    Attributes:
        tube: the liner.
        grid: control points over (s, x).
        s_mm, x_mm: (N,) points of quadrature.
        mounted: (K, 4) control values of the open wall.
        shell: the wall at those points.
        cuts: what is free, what is held, and what the cuts do.
        rows: the unknowns in blocks.
    """

    def __init__(
        self,
        tube: MountedTube,
        departure_mm: Array | None = None,
        arcs: int = ARCS,
        slabs: int = SLABS,
    ) -> None:
        """Builds the mesh.

        Args:
            tube: the liner.
            departure_mm: (K,) control values of the mounted wall's radial departure from the ideal tube.
            arcs: intervals round the half.
            slabs: intervals along the tube.
        """
        radius, half = tube.radius_mm, tube.length_mm / 2
        self.tube = tube
        self.grid = SplineGrid(
            SplineAxis.over(-np.pi / 2 * radius, np.pi / 2 * radius, arcs),
            SplineAxis.over(-half, half, slabs),
        )
        self.s_mm, self.x_mm, self._weights = self.grid.quadrature()
        self._basis = self.grid.basis(self.s_mm, self.x_mm)
        self.mounted = self._mounted(departure_mm)
        self._derivatives: dict[Basis, Array] = {}
        self.shell = Shell(self._basis, self._weights, self.wall(self._basis, tube))
        self.cuts = Cuts.of(self.grid)
        self._members = self._basis.members[::_POINTS]
        shape = (self.grid.along.count, self.grid.around.count, UNKNOWNS)
        self.rows = Rows.of(self.cuts.order.reshape(shape))
        # (N, 16, derivatives), and the same by patches: (P, 16, points × derivatives)
        self._by_point = np.ascontiguousarray(self._basis.values.transpose(1, 2, 0))
        values = self._basis.values.reshape(_DERIVATIVES, -1, _POINTS, _MEMBERS).transpose(1, 3, 2, 0)
        self._values = np.ascontiguousarray(values).reshape(len(values), _MEMBERS, -1)

    def of(self, tube: MountedTube, mounted: Array | None = None) -> "HalfTube":
        """The same mesh of a tube with another thickness, modulus or pretension.

        Args:
            tube: that tube.
            mounted: (K, 4) control values of the open wall, if they are others as well.
        """
        changed = copy.copy(self)
        changed.tube = tube
        if mounted is not None:
            changed.mounted, changed._derivatives = mounted, {}
        changed.shell = Shell(self._basis, self._weights, changed.wall(self._basis, tube))
        return changed

    def wall(self, basis: Basis, tube: MountedTube) -> RubberWall:
        """Rubber of a tube at points of the wall.

        Without stress, the wall is √λ times as wide and thick as mounted, and 1/λ times as long.
        """
        stretch = tube.stretch
        scale = np.array([1 / stretch, np.sqrt(stretch), np.sqrt(stretch), 0.0])
        if basis not in self._derivatives:
            self._derivatives[basis] = basis.derivatives(self.mounted)
        forms = Geometry.at(self._derivatives[basis] * scale).forms()
        thickness = np.full(len(basis.members), np.sqrt(stretch) * tube.thickness_mm)
        return RubberWall(forms, thickness, tube.young_mpa / 3)

    def moved(self, control: Array, unknowns: Array) -> Array:
        """(K, 4) control values moved by the unknowns (n,)."""
        return control + (self.cuts.free @ unknowns).reshape(control.shape)

    def at_rest(self) -> Array:
        """(K, 4) control values of the open wall in equilibrium without load.

        It is near `mounted`: a tapered tube with the same stretch all along slides by tenths of a millimetre.
        """
        none = np.zeros(len(self.s_mm))
        load = Load(0.0, none, np.stack([none, none]))
        settling = self.tangent(self.mounted, load).factors.solve(self.residual(self.mounted, load))
        return self.moved(self.mounted, settling)

    def residual(self, control: Array, load: Load) -> Array:
        """(n,) force out of balance on the unknowns: load less resistance, N."""
        return self.gathered(self.shell.work(control).unbalanced(load)[..., np.newaxis])[:, 0]

    def gathered(self, work: Array) -> Array:
        """(n, C) forces on the unknowns by work (N, 6, 4, C) at the points of quadrature."""
        return self.cuts.free.T @ self.shell.gathered(work).reshape(self.cuts.free.shape[0], -1)

    def tangent(self, control: Array, load: Load) -> Tangent:
        """Derivative of resistance less load at a state."""
        stiffness = self.shell.stiffness(control, load)
        band, edges, beside = self.rows.band(), [], []
        for slab, (patches, points) in enumerate(self._slabs()):
            weighted = stiffness[points] * self._weights[points, np.newaxis, np.newaxis]
            matrices = _stiffness_patches(self._values[patches], weighted)
            self.rows.add_stiffness(band, slab, matrices)
            edges.append(matrices[[0, -1]])
            beside.append(self._members[patches][[0, -1]])
        factors = Factors(self.rows, band)
        return Tangent(factors, np.concatenate(edges), np.concatenate(beside), self.cuts.order)

    def by_fields(self, work: Array) -> Array:
        """(R, 7 B, F, C) derivative of the residual by spline fields, as in `Forces`.

        Args:
            work: (N, 6, 4, F) of unit values of F fields at the points of quadrature, by the six derivatives.
        """
        fields, columns = work.shape[-1], self.grid.around.count
        bands = np.zeros((fields, self.rows.count, NEAR * self.rows.size, columns))
        for slab, (_, points) in enumerate(self._slabs()):
            weighted = work[points] * self._weights[points, np.newaxis, np.newaxis, np.newaxis]
            each = _field_patches(self._by_point[points], weighted)
            for field, band in enumerate(bands):
                self.rows.add_field(band, slab, each[:, :, field].reshape(-1, _PATCH, _MEMBERS))
        return np.ascontiguousarray(np.moveaxis(bands, 0, 2))

    def _slabs(self) -> Iterator[tuple[slice, slice]]:
        """Slices of the patches of each interval along, and of their points: few enough for a cache."""
        arcs = self.grid.around.count - DEGREE
        for first in range(0, len(self._values), arcs):
            yield slice(first, first + arcs), slice(first * _POINTS, (first + arcs) * _POINTS)

    def _mounted(self, departure_mm: Array | None) -> Array:
        """(K, 4) control values of the mounted wall: the splines nearest to it."""
        theta = self.s_mm / self.tube.radius_mm
        radius = self.tube.radius_mm - self.tube.taper * self.x_mm
        if departure_mm is not None:
            radius = radius + self._basis.of(departure_mm)
        points = np.column_stack([self.x_mm, radius * np.sin(theta), radius * np.cos(theta)])
        dense = self._basis.matrices[0]
        control = sparse.linalg.splu((dense.T @ dense).tocsc()).solve(dense.T @ points)
        return np.column_stack([control, np.zeros(len(control))])


def _stiffness_patches(values: Array, stiffness: Array) -> Array:
    """(P, 64, 64) matrices of patches, from weighted stiffness (N, 24, 24) at their points.

    Args:
        values: (P, 16, points × derivatives) of the splines.
        stiffness: by derivatives and unknowns.
    """
    patches = len(values)
    # Axes: patch, point, derivative e, unknown c, unknown d, derivative f. First the sum over f …
    parts = stiffness.reshape(patches, _POINTS, _DERIVATIVES, UNKNOWNS, _DERIVATIVES, UNKNOWNS)
    parts = parts.transpose(0, 1, 2, 3, 5, 4).reshape(patches, _POINTS, -1, _DERIVATIVES)
    by_order = values.reshape(patches, _MEMBERS, _POINTS, _DERIVATIVES).transpose(0, 2, 3, 1)
    half = np.matmul(parts, by_order).reshape(patches, _POINTS * _DERIVATIVES, -1)
    # … then the one over points and e.
    whole = np.matmul(values, half).reshape(patches, _MEMBERS, UNKNOWNS, UNKNOWNS, _MEMBERS)
    return whole.transpose(0, 1, 2, 4, 3).reshape(patches, _PATCH, _PATCH)


def _field_patches(values: Array, work: Array) -> Array:
    """(P, 64, F, 16) patches of F fields, from their weighted work (N, 6, 4, F) at the points.

    Args:
        values: (N, 16, derivatives) of the splines.
        work: by derivatives and unknowns, for each field.
    """
    moved = values @ work.reshape(len(work), _DERIVATIVES, -1)
    parts = moved.reshape(-1, _POINTS, moved[0].size).transpose(0, 2, 1)
    field_values = values[:, :, 0].reshape(-1, _POINTS, _MEMBERS)
    return (parts @ field_values).reshape(len(parts), _PATCH, work.shape[-1], _MEMBERS)
