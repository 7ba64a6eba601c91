"""Energy of an incompressible wall, through its thickness, as a function of its middle surface's forms.

A material normal stays straight, and every layer keeps its volume: a layer that lay at depth ζ lies at z with

    z + H z² + K z³/3 = (ζ + H₀ ζ² + K₀ ζ³/3) / J

where H and K are the mean and Gaussian curvature, positive for a round wall, J the stretch of the middle
surface's area, ζ outward. For cylinders, spheres, plane bending and axial stretch that is Rivlin's exact
solution of a thick neo-Hookean body, not an approximation for a thin one; both faces then do work at their
true places.

Forms are covariant components 11, 22, 12 (1 round the wall, 2 along it).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from grabberd_liner.analysis.gauss import gauss_rule
from grabberd_liner.arrays import Array

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
