"""Equilibrium of the wall at a position: loads carried by tension and bending, and the remainder on the teat.

    p_contact · a = (p_pulsation − p_liner) + T:κ − ∇∇:M

inward positive, all tensors of the middle surface in one basis; a is the inner face's area by the middle
surface's. T is what the law makes of the stretches, M = D [(1 − ν) k + ν tr k g] with the change k of the
second form.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.surface.jets import Jets
from grabberd.analysis.wall.bending import (
    Matrix,
    MiddleSurface,
    frozen,
    jets_gradient,
    middle_surface,
    moment_divergence,
)
from grabberd.analysis.wall.forms import determinant, trace
from grabberd.analysis.wall.material import Wall, Zone, wall_at
from grabberd.analysis.wall.taylor import Taylor, gradients
from grabberd.analysis.wall.tension import mixed_tension

Array = NDArray[np.float64]

_KPA = 1e3
_STEP = 1e-5
_METRIC = ((0, 0), (0, 1), (1, 1))


class WallShape(NamedTuple):
    """The wall at N places, as far as it does not depend on the modulus and the pre-tension.

    Attributes:
        middle: its middle surface.
        divergence: ∇∇:M / D, 1/mm³.
    """

    middle: MiddleSurface
    divergence: Taylor


class Slope(NamedTuple):
    """The contact pressure at N places and its derivatives.

    Attributes:
        contact_kpa: (N,).
        by_jets: (N, 15, 3) by the face's jets, kPa / (mm / mm^order).
        by_reference: (N, 15, 3) by the reference's.
    """

    contact_kpa: Array
    by_jets: Array
    by_reference: Array


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """The equilibrium at N material positions, against a reference state, for any number of fields.

    Several fields may be evaluated together: jets (F, N, 15, 3), results (F, N).

    Attributes:
        wall: the material at the positions.
        reference: the middle surface there in the unbent reference state.
        outward: 1.0 if X_u × X_v points outward, −1.0 if inward (`Grid.outward`).
    """

    wall: Wall
    reference: MiddleSurface
    outward: float

    @classmethod
    def of(
        cls,
        zones: Sequence[Zone],
        u_mm: Array,
        reference_jets: Jets,
        outward: float = 1.0,
        exact: bool = False,
    ) -> "Equilibrium":
        """The equilibrium at N places.

        Args:
            zones: material of the wall.
            u_mm: (N,) coordinates along the liner.
            reference_jets: (N, 15, 3) jets of the face in the reference state.
            outward: as in the class.
            exact: True if the reference state has no σ, so that derivatives by it are not needed.

        Raises:
            AnalysisError: a position lies in no zone or in two.
        """
        wall = wall_at(zones, u_mm)
        reference = middle_surface(reference_jets, wall.depth_mm, outward)
        return cls(wall, frozen(reference) if exact else reference, outward)

    def shape(self, jets: Jets) -> WallShape:
        """The wall at one field, from the face's jets (N, 15, 3)."""
        middle = middle_surface(jets, self.wall.depth_mm, self.outward)
        return WallShape(middle, moment_divergence(middle, self.reference.second_per_mm, self.wall.poisson))

    def wall_kpa(self, shape: WallShape) -> Array:
        """(N,) T:κ − ∇∇:M, what the wall itself presses inward, on the middle surface."""
        first, reference, curvature = self._tensors(shape)
        carried = trace(mixed_tension(first, reference, self.wall) @ curvature)
        result: Array = _KPA * (carried - self.wall.stiffness_nmm * shape.divergence.values[0])
        return result

    def inner_area(self, shape: WallShape) -> Array:
        """(N,) area of the inner face by that of the middle surface."""
        curvature, half = _at_place(shape.middle.curvature_per_mm), self.wall.wall_mm / 2
        return 1 - half * trace(curvature) + half**2 * determinant(curvature)

    def contact_kpa(self, shape: WallShape, difference_kpa: float | Array) -> Array:
        """(N,) the contact pressure.

        Args:
            shape: of the same field.
            difference_kpa: p_pulsation − p_liner, which is the liner's vacuum less the pulsation chamber's.
        """
        result: Array = (difference_kpa + self.wall_kpa(shape)) / self.inner_area(shape)
        return result

    def slope(self, shape: WallShape, difference_kpa: float | Array) -> Slope:
        """The contact pressure with its derivatives by everything measured."""
        contact, area = self.contact_kpa(shape, difference_kpa), self.inner_area(shape)
        by_first, by_reference = self._by_metrics(shape, area)
        seeds = [
            *_seeds(_upper(shape.middle.first), by_first),
            *_seeds(_upper(self.reference.first), by_reference),
            *_seeds(_all(shape.middle.curvature_per_mm), self._by_curvature(shape, contact, area)),
            *_seeds([shape.divergence], [-_KPA * self.wall.stiffness_nmm / area]),
        ]
        own = [series for vector in shape.middle.face for series in vector]
        other = [series for vector in self.reference.face for series in vector]
        bars = gradients(seeds, own + other)
        return Slope(contact, jets_gradient(bars[: len(own)]), jets_gradient(bars[len(own) :]))

    def _tensors(self, shape: WallShape) -> tuple[Array, Array, Array]:
        middle = shape.middle
        return _at_place(middle.first), _at_place(self.reference.first), _at_place(middle.curvature_per_mm)

    def _by_curvature(self, shape: WallShape, contact: Array, area: Array) -> list[Array]:
        """Derivatives by κ11, κ12, κ21, κ22, mixed components."""
        first, reference, curvature = self._tensors(shape)
        tension, half = mixed_tension(first, reference, self.wall), self.wall.wall_mm / 2
        result = []
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            same = 1.0 if i == j else 0.0
            cofactor = curvature[..., 1 - i, 1 - j] * (1.0 if i == j else -1.0)
            by_area = -half * same + half**2 * cofactor
            result.append((_KPA * tension[..., j, i] - contact * by_area) / area)
        return result

    def _by_metrics(self, shape: WallShape, area: Array) -> tuple[list[Array], list[Array]]:
        """Derivatives by g11, g12, g22 of the present state and of the reference."""
        first, reference, curvature = self._tensors(shape)
        steps = _STEP * np.array([[[1, 0], [0, 0]], [[0, 1], [1, 0]], [[0, 0], [0, 1]]])
        steps = steps.reshape(3, *[1] * (first.ndim - 2), 2, 2)

        def carried(present: Array, before: Array) -> Array:
            result: Array = trace(mixed_tension(present, before, self.wall) @ curvature)
            return result

        by_first = carried(first + steps, reference) - carried(first - steps, reference)
        by_reference = carried(first, reference + steps) - carried(first, reference - steps)
        scale = _KPA / (2 * _STEP * area)
        return list(by_first * scale), list(by_reference * scale)


def _at_place(matrix: Matrix) -> Array:
    """(..., 2, 2) the values of a matrix of series."""
    (a, b), (c, d) = matrix
    return np.stack([s.values[0] for s in (a, b, c, d)], axis=-1).reshape(*a.values.shape[1:], 2, 2)


def _upper(matrix: Matrix) -> list[Taylor]:
    return [matrix[i][j] for i, j in _METRIC]


def _all(matrix: Matrix) -> list[Taylor]:
    return [series for row in matrix for series in row]


def _seeds(series: Sequence[Taylor], by_value: Sequence[Array]) -> list[tuple[Taylor, Array]]:
    seeds = []
    for one, slope in zip(series, by_value, strict=True):
        bar = np.zeros((len(one.values), *slope.shape))
        bar[0] = slope
        seeds.append((one, bar))
    return seeds
