"""Prior knowledge of the load and of the liner, before any field is looked at.

A teat cannot pull, so the contact pressure is a rising function of a Gaussian process g that is nowhere
negative,

    p = (g + √(g² + 4 b²)) / 2

with b a few kPa: p ≈ g where the teat presses, and dies out where it does not. Unlike an exponential or a
soft plus it falls off so slowly that a place without contact is never too dead for a step to wake it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.wall.half_tube import cut_points
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.analysis.wall.splines import SplineGrid
from grabberd_liner.arrays import Array

MPA_PER_KPA = 1e-3
_NUGGET = 1e-8
"""Share of the variance that keeps a covariance of neighbouring splines positive definite in rounding."""
_EXACT = 1e-4
"""Relative σ of a value of the liner that is given as exact."""
_NORMAL, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_SHARES = _WEIGHTS / _WEIGHTS.sum()
"""Points of Gauss–Hermite quadrature over g, and their shares: a contact pressure's moments to 1e-4."""


@dataclass(frozen=True, slots=True)
class LoadPrior:
    """Prior of the load on the inner face.

    Attributes:
        softness_kpa: b, under which a contact pressure dies out.
        mean: mean of g on the line that faces the cameras, by the pressure difference.
        falloff: by how many times that the mean falls towards the cuts: the wall folds there, away from the
            teat.
        amplitude: standard deviation of g, by the pressure difference: the wall has no more to press with.
        least_kpa: the pressure difference is taken for at least that.
        round_mm, along_mm: lengths over which g is correlated.
        traction_kpa: standard deviation of friction, in either direction.
        shift_mm, turn_rad, force_n_per_mm: standard deviations of what the hidden half does to the cuts.
        cut_mm: length over which that is correlated.
        model_mm_per_kpa2: standard deviation by which a target is elsewhere than in the model's wall, in any
            direction, over the square of the pressure difference: what splines and rubber do not follow.
    """

    softness_kpa: float = 2.5
    mean: float = -1.0
    falloff: float = 8.0
    amplitude: float = 1.4
    least_kpa: float = 15.0
    round_mm: float = 6.0
    along_mm: float = 4.5
    traction_kpa: float = 4.5
    shift_mm: float = 0.7
    turn_rad: float = 0.06
    force_n_per_mm: float = 0.05
    cut_mm: float = 20.0
    model_mm_per_kpa2: float = 9e-6

    def contact_mpa(self, g_mpa: Array) -> tuple[Array, Array]:
        """Contact pressure, and its derivative by g."""
        softness = self.softness_kpa * MPA_PER_KPA
        root = np.sqrt(g_mpa**2 + 4 * softness**2)
        return (g_mpa + root) / 2, (1 + g_mpa / root) / 2

    def spread_mpa(self, g_mpa: Array, sigma_mpa: Array) -> Array:
        """Standard deviation of the contact pressure for a g with a standard deviation of its own."""
        pressures, _ = self.contact_mpa(g_mpa[..., np.newaxis] + sigma_mpa[..., np.newaxis] * _NORMAL)
        mean = pressures @ _SHARES
        return np.sqrt(((pressures - mean[..., np.newaxis]) ** 2) @ _SHARES)

    def model_mm(self, difference_kpa: float) -> float:
        """Standard deviation of the model's own error in a target's place."""
        return self.model_mm_per_kpa2 * difference_kpa**2

    def _scale_mpa(self, difference_kpa: float) -> float:
        return max(difference_kpa, self.least_kpa) * MPA_PER_KPA

    def mean_mpa(self, grid: SplineGrid, difference_kpa: float) -> Array:
        """(K,) prior mean of g's control values under a pressure difference."""
        # Level beyond 45°: farther from contact than that, no data would be believed.
        turned = np.minimum(np.abs(grid.around.greville) / grid.around.greville[-1], 0.5)
        around = self.mean * self._scale_mpa(difference_kpa) * (1 + self.falloff * turned**2)
        return np.tile(around, grid.along.count)

    def scale_mpa(self, difference_kpa: float) -> float:
        """Standard deviation of g under a pressure difference."""
        return self.amplitude * self._scale_mpa(difference_kpa)

    def spread(self, grid: SplineGrid, columns: Array) -> Array:
        """(3, K, M) prior covariance times columns (3, K, M): of g by its variance, of tractions in MPa²."""
        around = _correlation(grid.around.greville, self.round_mm)
        along = _correlation(grid.along.greville, self.along_mm)
        # The covariance of a grid is the product of its rows' and its columns'.
        parts = along @ columns.reshape(3, grid.along.count, -1)
        spread = (around @ parts.reshape(3, grid.along.count, grid.around.count, -1)).reshape(columns.shape)
        spread += _NUGGET * columns
        spread[1:] *= self._traction_mpa2
        return np.asarray(spread, np.float64)

    @property
    def _traction_mpa2(self) -> float:
        return (self.traction_kpa * MPA_PER_KPA) ** 2

    def cut_covariances(self, grid: SplineGrid) -> list[Array]:
        """(A, A) covariances of both cuts' shift (mm²), turn (rad²) and force (N²/mm²)."""
        along = grid.along.greville[cut_points(grid)]
        correlation = _correlation(along, self.cut_mm) + _NUGGET * np.eye(len(along))
        deviations = (self.shift_mm, self.turn_rad, self.force_n_per_mm)
        return [sigma**2 * correlation for sigma in deviations for _ in range(2)]


@dataclass(frozen=True, slots=True)
class TubePrior:
    """Prior knowledge of the liner.

    Attributes:
        young, thickness, pretension: standard deviations of the logarithms.
        correlations: of young and thickness, young and pretension, thickness and pretension.
    """

    young: float
    thickness: float
    pretension: float
    correlations: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, material: Material) -> "TubePrior":
        """Prior knowledge from a material."""
        return cls(
            max(material.E_sigma_mpa / material.E_mpa, _EXACT),
            max(material.wall_sigma_mm / material.wall_mm, _EXACT),
            max(material.F0_sigma_n / material.F0_n, _EXACT) if material.F0_n else _EXACT,
            material.correlations,
        )

    @property
    def covariance(self) -> Array:
        """(3, 3) of the logarithms."""
        sigma = np.array([self.young, self.thickness, self.pretension])
        upper = np.zeros((3, 3))
        upper[np.triu_indices(3, 1)] = self.correlations
        return np.outer(sigma, sigma) * (np.eye(3) + upper + upper.T)


class Difference(NamedTuple):
    """Pressure difference, outside over inside, with its standard deviation."""

    kpa: float
    sigma_kpa: float


def _correlation(at_mm: Array, length_mm: float) -> Array:
    distance = (at_mm[:, np.newaxis] - at_mm) / length_mm
    return np.exp(-0.5 * distance**2)
