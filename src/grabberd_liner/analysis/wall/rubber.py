"""Energy of an incompressible wall, through its thickness, as a function of its middle surface's forms.

A material normal stays straight, and every layer keeps its volume: a layer that lay at depth ζ lies at z with

    z + H z² + K z³/3 = (ζ + H₀ ζ² + K₀ ζ³/3) / J

where H and K are the mean and Gaussian curvature, positive for a round wall, J the stretch of the middle
surface's area, ζ outward. For cylinders, spheres, plane bending and axial stretch that is Rivlin's exact
solution of a thick neo-Hookean body, not an approximation for a thin one; both faces then do work at their
true places.

Forms are covariant components 11, 22, 12 (1 round the wall, 2 along it).

Unknowns of the wall in blocks, one for each row of control points round it; factors of its stiffness, and
forces on it by its parameters, block by block.

Patches reach over four rows of control points, so a block has to do with the three before and after it. All
are equally large: a place that is held takes part as a number that is always zero. The stiffness is nearly
symmetric, and positive unless the wall is about to buckle, so pivots are sought within a block alone;
products of blocks are several times faster than solving column by column.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd_liner.analysis.wall.splines import DEGREE, gauss_rule

LAYERS = 5
"""Gauss points through the wall.

The moment of a flat wall is right to 5e-6 if it is bent to an inner radius of 2.4 times its thickness, and to
.2 % at .8 times.
"""
_NEWTON_STEPS = 5
"""From the flat wall's depth; quadratic, so exact to rounding unless the wall folds through itself."""
_STEP = 1e-30
"""Of complex differentiation, which loses no digits however small its step."""


class Forms(NamedTuple):
    """Forms of a surface at N points.

    Attributes:
        metric: (3, N) a11, a22, a12.
        curvature: (3, N) b11, b22, b12 per mm, positive for a round wall.
    """

    metric: Array
    curvature: Array


class Layer(NamedTuple):
    """Position of a layer after deformation.

    Attributes:
        depth_mm: (N,) outward from the middle surface.
        by_forms: (6, N) its derivatives by a11, a22, a12, b11, b22, b12.
    """

    depth_mm: Array
    by_forms: Array


@dataclass(frozen=True, slots=True, eq=False)
class Invariants:
    """Mean and Gaussian curvature and the metric's determinant at N points."""

    forms: Forms
    determinant: Array
    mean: Array
    gauss: Array

    @classmethod
    def of(cls, forms: Forms) -> "Invariants":
        """Invariants of a surface with these forms."""
        a, b = forms
        determinant = _determinant(a)
        mean = (_cofactors(a) * b).sum(axis=0) / (2 * determinant)
        return cls(forms, determinant, mean, _determinant(b) / determinant)

    def area(self, depth: Array) -> Array:
        """Area of the layer at a depth per area of the middle surface."""
        return 1 + depth * (2 * self.mean + self.gauss * depth)

    def volume(self, depth: Array) -> Array:
        """Volume between the middle surface and the layer at a depth, per area of the middle surface."""
        # Horner's scheme, because a power of a complex number is slow.
        return depth * (1 + depth * (self.mean + depth * self.gauss / 3))

    def metric_shares(self, depth: Array) -> tuple[Array, Array]:
        """Shares of a and b in the metric of the layer at a depth.

        That metric is a + 2 z b + z² b a⁻¹ b, in which b a⁻¹ b = 2 H b − K a (Cayley and Hamilton).
        """
        return 1 - self.gauss * depth**2, 2 * depth + 2 * self.mean * depth**2

    def chained(self, by_mean: Array, by_gauss: Array, by_determinant: Array) -> Array:
        """(6, N) derivatives by the forms of a function whose derivatives by H, K and det a are given."""
        of_determinant, of_trace = _cofactors(self.forms.metric), _cofactors(self.forms.curvature)
        mean_by_metric = (of_trace / 2 - self.mean * of_determinant) / self.determinant
        gauss_by_metric = -self.gauss * of_determinant / self.determinant
        by_metric = by_mean * mean_by_metric + by_gauss * gauss_by_metric + by_determinant * of_determinant
        by_curvature = (by_mean * of_determinant / 2 + by_gauss * of_trace) / self.determinant
        return np.concatenate([by_metric, by_curvature])


@dataclass(frozen=True, eq=False)
class RubberWall:
    """A wall at N points.

    Attributes:
        unstressed: forms of the middle surface without stress.
        thickness_mm: (N,) of the wall without stress.
        shear_mpa: shear modulus µ; Young's modulus is three times that.
    """

    unstressed: Forms
    thickness_mm: Array
    shear_mpa: float

    @property
    def area(self) -> Array:
        """(N,) unstressed area per area of the parameters."""
        return np.sqrt(_determinant(self.unstressed.metric))

    def energy(self, forms: Forms) -> Array:
        """(N,) energy per unstressed area, N/mm."""
        layers = _Layers.of(self._rest, Invariants.of(forms))
        return self.shear_mpa / 2 * (self._rest.weights * layers.strain()).sum(axis=0)

    def resultants(self, forms: Forms) -> Array:
        """(6, N) derivatives of the energy by a11, a22, a12, b11, b22, b12."""
        rest, now = self._rest, Invariants.of(forms)
        by_p, by_q, *by_invariants = (rest.weights * slope for slope in _Layers.of(rest, now).slopes())
        through_inverse = [(slope * rest.inverse).sum(axis=1) for slope in (by_p, by_q)]
        through_invariants = now.chained(*(slope.sum(axis=0) for slope in by_invariants))
        return self.shear_mpa / 2 * (np.concatenate(through_inverse) + through_invariants)

    def stiffness(self, forms: Forms) -> Array:
        """(6, 6, N) second derivatives of the energy, by complex steps of the first."""
        return complex_step(
            lambda stepped: self.resultants(Forms(stepped[:3], stepped[3:])), np.concatenate(forms)
        )

    def layer(self, forms: Forms, share: float) -> Layer:
        """Finds the layer that lay at a share of the thickness: ½ is the outer face, −½ the inner one."""
        now, before = Invariants.of(forms), self._before
        stretch = np.sqrt(now.determinant / before.determinant)
        volume = before.volume(share * self.thickness_mm) / stretch
        depth = _depth(volume, now)
        return Layer(depth, now.chained(*_depth_slopes(depth, volume, now)))

    @cached_property
    def _before(self) -> Invariants:
        return Invariants.of(self.unstressed)

    @cached_property
    def _rest(self) -> "_Rest":
        return _Rest.of(self._before, self.thickness_mm)


@dataclass(frozen=True, slots=True, eq=False)
class _Rest:
    """Layers without stress, L of them at N points.

    Attributes:
        before: invariants of the middle surface.
        zeta: (L, N) depths.
        weights: (L, N) of the quadrature, volume per area of the middle surface.
        inverse: (3, L, N) inverse metric of the layers; the off-diagonal component is doubled, because it
            stands twice in a contraction.
    """

    before: Invariants
    zeta: Array
    weights: Array
    inverse: Array

    @classmethod
    def of(cls, before: Invariants, thickness_mm: Array) -> "_Rest":
        unstressed = before.forms
        local, weights = gauss_rule(LAYERS)
        zeta = np.multiply.outer(local, thickness_mm / 2)
        volumes = np.multiply.outer(weights, thickness_mm / 2) * before.area(zeta)
        flat, bent = before.metric_shares(zeta)
        metric = flat * unstressed.metric[:, np.newaxis] + bent * unstressed.curvature[:, np.newaxis]
        return cls(before, zeta, volumes, _cofactors(metric) / _determinant(metric))

    def stretch(self, now: Invariants) -> Array:
        """(N,) area of the middle surface over its unstressed one."""
        return np.sqrt(now.determinant / self.before.determinant)


@dataclass(frozen=True, slots=True, eq=False)
class _Layers:
    """Layers after deformation, L of them at N points.

    Attributes:
        now: invariants of the middle surface.
        volume: (L, N) between middle surface and layer, per area of the middle surface.
        z: (L, N) depths.
        p, q: (L, N) unstressed inverse metric contracted with a and with b.
        thinning: (L, N) square of the stretch across the wall.
    """

    now: Invariants
    volume: Array
    z: Array
    p: Array
    q: Array
    thinning: Array

    @classmethod
    def of(cls, rest: _Rest, now: Invariants) -> "_Layers":
        stretch = rest.stretch(now)
        volume = rest.before.volume(rest.zeta) / stretch
        z = _depth(volume, now)
        p, q = ((rest.inverse * form[:, np.newaxis]).sum(axis=0) for form in now.forms)
        thinning = (rest.before.area(rest.zeta) / (stretch * now.area(z))) ** 2
        return cls(now, volume, z, p, q, thinning)

    def strain(self) -> Array:
        """(L, N) I₁ − 3, the sum of the squared principal stretches less three."""
        flat, bent = self.now.metric_shares(self.z)
        return self.p * flat + self.q * bent + self.thinning - 3

    def slopes(self) -> tuple[Array, ...]:
        """Derivatives (L, N) of that strain by P, Q, H, K and det a; depths follow the last three."""
        z, now, p, q, thinning = self.z, self.now, self.p, self.q, self.thinning
        area = now.area(z)
        area_by_z = 2 * (now.mean + now.gauss * z)
        by_z = -2 * p * now.gauss * z + q * (2 + 4 * now.mean * z) - 2 * thinning * area_by_z / area
        at_fixed_depth = (
            2 * q * z**2 - 4 * thinning * z / area,
            -p * z**2 - 2 * thinning * z**2 / area,
            -thinning / now.determinant,
        )
        moving = _depth_slopes(z, self.volume, now)
        through = (fixed + by_z * slope for fixed, slope in zip(at_fixed_depth, moving, strict=True))
        return (*now.metric_shares(z), *through)


def complex_step(function: Callable[[Any], Any], at: Array) -> Array:
    """(P, Q, N) derivatives at (Q, N) of an analytic function (Q, N) → (P, N), exact to rounding.

    Args:
        function: called with complex arrays.
        at: real arguments.
    """
    steps = 1j * _STEP * np.eye(len(at))[:, :, np.newaxis]
    return np.stack([function(at + step).imag / _STEP for step in steps], axis=1)


def _depth(volume: Array, now: Invariants) -> Array:
    """Depth of the layers that enclose a volume per area with the middle surface, by Newton's method."""
    z = volume
    for _ in range(_NEWTON_STEPS):
        z = z - (now.volume(z) - volume) / now.area(z)
    return z


def _depth_slopes(depth: Array, volume: Array, now: Invariants) -> tuple[Array, Array, Array]:
    """Derivatives of the depth by H, K and det a; the volume shrinks as the surface's area grows."""
    area = now.area(depth)
    by_mean = -depth * depth / area
    return by_mean, by_mean * depth / 3, -volume / (2 * now.determinant * area)


def _determinant(form: Array) -> Array:
    return form[0] * form[1] - form[2] ** 2


def _cofactors(form: Array) -> Array:
    """Derivatives of the determinant by the components 11, 22, 12, (3, …) like the form."""
    return np.stack([form[1], form[0], -2 * form[2]])


NEAR = 2 * DEGREE + 1
"""Blocks that a block has to do with, itself included."""
_SPAN = DEGREE + 1
"""Control points of a patch in either direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Places of the unknowns, R blocks of B, for C control points in a row.

    Attributes:
        count: R; `size`: B.
        unknowns: (n,) place of each unknown in all R B; `held`: (R, B) True for places that no unknown has.
        free: (slabs, arcs, 64) 1 for control values of a patch that follow an unknown, 0 for held ones.
    """

    count: int
    size: int
    unknowns: Indices
    held: Mask
    free: Array
    _stiffness: Indices
    _fields: Indices

    @classmethod
    def of(cls, order: Indices) -> "Rows":
        """Blocks for control values whose unknowns' numbers are `order` (R, C, 4); −1 for held ones."""
        rows, columns, values = order.shape
        first = order[rows // 2][order[rows // 2] >= 0].min()
        # A place within a block is the same in all rows; those at the ends only lack some.
        local = np.where(order[rows // 2] >= 0, order[rows // 2] - first, 0)
        size = int(local.max()) + 1
        row = np.broadcast_to(np.arange(rows)[:, np.newaxis, np.newaxis], order.shape)
        unknowns = np.zeros(int(order.max()) + 1, np.intp)
        unknowns[order[order >= 0]] = (row * size + local)[order >= 0]
        held = np.ones(rows * size, np.bool_)
        held[unknowns] = False
        arcs = np.arange(columns - DEGREE)[:, np.newaxis] + np.arange(_SPAN)
        slabs = np.arange(rows - DEGREE)[:, np.newaxis] + np.arange(_SPAN)
        free = order[slabs[:, np.newaxis, :, np.newaxis], arcs[np.newaxis, :, np.newaxis]] >= 0
        of_patch = np.broadcast_to(local[arcs][:, np.newaxis], (len(arcs), _SPAN, _SPAN, values))
        return cls(
            rows,
            size,
            unknowns,
            held.reshape(rows, size),
            free.reshape(len(slabs), len(arcs), -1).astype(np.float64),
            _stiffness_places(of_patch, size),
            _field_places(of_patch, arcs, size, columns),
        )

    def band(self) -> Array:
        """(R, B, 7 B) matrix of what is held: by blocks, beside those from three rows before them on."""
        band = np.zeros((self.count, self.size, NEAR * self.size))
        row, place = self.held.nonzero()
        band[row, place, DEGREE * self.size + place] = 1.0
        return band

    def add_stiffness(self, band: Array, slab: int, patches: Array) -> None:
        """Adds the matrices (arcs, 64, 64) of a slab's patches to a band."""
        free = self.free[slab]
        weighted = patches * free[:, :, np.newaxis] * free[:, np.newaxis]
        rows = band[slab : slab + _SPAN]
        rows += np.bincount(self._stiffness, weighted.ravel(), rows.size).reshape(rows.shape)

    def add_field(self, band: Array, slab: int, patches: Array) -> None:
        """Adds patches (arcs, 64, 16), values moved by control values, to a field's band (R, 7 B, C)."""
        weighted = patches * self.free[slab][:, :, np.newaxis]
        rows = band[slab : slab + _SPAN]
        rows += np.bincount(self._fields, weighted.ravel(), rows.size).reshape(rows.shape)

    def padded(self, right: Array) -> Array:
        """((R + 6) B, M) what belongs to the unknowns (n, M), in blocks; three of zeros before and after."""
        padded = np.zeros(((self.count + 2 * DEGREE) * self.size, right.shape[1]))
        padded[self.unknowns + DEGREE * self.size] = right
        return padded

    def unpadded(self, padded: Array) -> Array:
        """(n, M) what belongs to the unknowns, from blocks."""
        return padded[self.unknowns + DEGREE * self.size]


def _stiffness_places(local: Indices, size: int) -> Indices:
    """Place of each entry of a slab's patches in its four rows of the band; `local`: (arcs, 4, 4, 4)."""
    row, place = _rows_of(local), local
    step = row[:, np.newaxis] - row[:, :, np.newaxis] + DEGREE  # [arc, entry's row, entry's column]
    flat = place.reshape(len(place), -1)
    column = step * size + flat[:, np.newaxis]
    places = (row[:, :, np.newaxis] * size + flat[:, :, np.newaxis]) * (NEAR * size) + column
    return np.asarray(places.ravel(), np.intp)


def _field_places(local: Indices, arcs: Indices, size: int, columns: int) -> Indices:
    """Place of each entry (arcs, 64, 16) of a slab's patches in its four rows of a field's band."""
    row, flat = _rows_of(local), local.reshape(len(local), -1)
    field_row = np.repeat(np.arange(_SPAN), _SPAN)
    field_column = np.tile(arcs, (1, _SPAN))
    step = row[:, :, np.newaxis] - field_row + DEGREE
    places = (field_row * NEAR + step) * size + flat[:, :, np.newaxis]
    return np.asarray((places * columns + field_column[:, np.newaxis]).ravel(), np.intp)


def _rows_of(local: Indices) -> Indices:
    """(arcs, 64) row of each control value of a patch, from 0 to 3."""
    row = np.arange(_SPAN)[np.newaxis, :, np.newaxis, np.newaxis]
    return np.broadcast_to(row, local.shape).reshape(len(local), -1)


class Factors:
    """Factors of a matrix, for its solutions and its transpose's."""

    def __init__(self, rows: Rows, band: Array) -> None:
        """Factors the matrix.

        Args:
            rows: blocks of its unknowns.
            band: (R, B, 7 B) as in `Rows.band`.

        Raises:
            np.linalg.LinAlgError: a block is singular.
        """
        self._rows, size, later = rows, rows.size, DEGREE * rows.size
        self._inverse = np.empty((rows.count, size, size))
        self._lower = np.empty((rows.count, later, size))
        self._upper = np.empty((rows.count, size, later))
        window = np.zeros((later + size, later + size))
        for row in range(-DEGREE, rows.count):
            # The window moves on by a block: what is left of it, and one row and one column more.
            window[:later, :later] = window[size:, size:]
            window[later:], window[:, later:] = 0.0, 0.0
            if row + DEGREE < rows.count:
                window[later:] = band[row + DEGREE, :, : later + size]
                for above in range(max(row, 0), row + DEGREE):
                    block = band[above, :, (2 * DEGREE + row - above) * size :][:, :size]
                    window[(above - row) * size : (above - row + 1) * size, later:] = block
            if row < 0:
                continue
            self._inverse[row] = np.linalg.inv(window[:size, :size])
            self._upper[row] = window[:size, size:]
            np.matmul(window[size:, :size], self._inverse[row], out=self._lower[row])
            window[size:, size:] -= self._lower[row] @ self._upper[row]

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """(n,) or (n, M) solutions for right-hand sides of that shape."""
        solved = self._rows.padded(right.reshape(len(right), -1))
        (self._solve_transposed if transposed else self._solve)(solved)
        return self._rows.unpadded(solved).reshape(right.shape)

    def _solve(self, solved: Array) -> None:
        for row in range(self._rows.count):
            own, later = self._parts(row)
            solved[later] -= self._lower[row] @ solved[own]
        for row in reversed(range(self._rows.count)):
            own, later = self._parts(row)
            solved[own] = self._inverse[row] @ (solved[own] - self._upper[row] @ solved[later])

    def _solve_transposed(self, solved: Array) -> None:
        for row in range(self._rows.count):
            own, later = self._parts(row)
            solved[own] = self._inverse[row].T @ solved[own]
            solved[later] -= self._upper[row].T @ solved[own]
        for row in reversed(range(self._rows.count)):
            own, later = self._parts(row)
            solved[own] -= self._lower[row].T @ solved[later]

    def _parts(self, row: int) -> tuple[slice, slice]:
        """A block's own places among the padded ones, and those of the three after it."""
        start, size = (row + DEGREE) * self._rows.size, self._rows.size
        return slice(start, start + size), slice(start + size, start + (DEGREE + 1) * size)


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """Derivative (n, P) of the force out of balance by F fields' control values and by Q other parameters.

    Attributes:
        rows: blocks of the unknowns.
        fields: (R, 7 B, F, C) by the control values of each row, in the blocks from three before it on.
        others: (n, Q).
    """

    rows: Rows
    fields: Array
    others: Array

    @property
    def _by_row(self) -> Array:
        """(R, 7 B, F C)."""
        return self.fields.reshape(*self.fields.shape[:2], -1)

    def of(self, change: Array) -> Array:
        """(n,) force of a change (P,) of the parameters; the control values of each field stand together."""
        rows, _, fields, columns = self.fields.shape
        count = rows * fields * columns
        by_row = change[:count].reshape(fields, rows, columns).transpose(1, 0, 2).reshape(rows, -1, 1)
        blocks = (self._by_row @ by_row).reshape(rows, NEAR, self.rows.size)
        force = np.zeros((rows + NEAR - 1, self.rows.size))
        for step in range(NEAR):
            force[step : step + rows] += blocks[:, step]
        return self.rows.unpadded(force.reshape(-1, 1))[:, 0] + self.others @ change[count:]

    def transposed(self, adjoint: Array) -> Array:
        """(M, P) products with columns (n, M)."""
        rows, near, fields, columns = self.fields.shape
        padded, by_row = self.rows.padded(adjoint), self._by_row
        products = np.empty((adjoint.shape[1], fields, rows, columns))
        for row in range(rows):
            start = row * self.rows.size
            product = padded[start : start + near].T @ by_row[row]
            products[:, :, row] = product.reshape(-1, fields, columns)
        return np.hstack([products.reshape(len(products), -1), adjoint.T @ self.others])
