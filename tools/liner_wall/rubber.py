"""Rubber: stress and stiffness of a nearly incompressible solid from its deformation gradient.

The strain energy per undeformed volume is

    W = c1 (I1 − 3 − 2 ln J) + c2 (I1 − 3)² + p (J − 1) − p² / 2κ

with the pressure p as an unknown of its own. c2 = 0 is neo-Hookean rubber; with c2 > 0 (Yeoh, 1993, without
the third term) it stiffens as it stretches. Stress is in MPa.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BULK_OVER_SHEAR = 2e4
"""κ/µ. At 50 kPa and µ = 1 MPa the volume then changes by 3e-6, far below what a target's place can show."""


@dataclass(frozen=True, slots=True)
class Rubber:
    """One law.

    Attributes:
        shear_mpa: µ of small strain, a third of Young's modulus.
        stiffening: c2/c1, 0 for neo-Hookean rubber.
    """

    shear_mpa: float
    stiffening: float = 0.0

    @property
    def bulk_mpa(self) -> float:
        """Bulk modulus κ."""
        return BULK_OVER_SHEAR * self.shear_mpa

    def stress(self, gradient: Array, pressure_mpa: Array) -> Array:
        """First Piola–Kirchhoff stress (…, 3, 3) for F (…, 3, 3) and p (…)."""
        slope, _ = self._slopes(gradient)
        inverse_t = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        volume = np.linalg.det(gradient)
        spherical = pressure_mpa * volume - self.shear_mpa
        stress: Array = 2 * slope[..., None, None] * gradient + spherical[..., None, None] * inverse_t
        return stress

    def stiffness(self, gradient: Array, pressure_mpa: Array) -> Array:
        """∂P_iJ/∂F_kL (…, 3, 3, 3, 3) at constant p."""
        slope, curvature = self._slopes(gradient)
        inverse_t = np.swapaxes(np.linalg.inv(gradient), -1, -2)
        volume = np.linalg.det(gradient)
        unit = np.einsum("ik,JL->iJkL", np.eye(3), np.eye(3))
        outer = np.einsum("...iJ,...kL->...iJkL", inverse_t, inverse_t)
        swapped = np.einsum("...iL,...kJ->...iJkL", inverse_t, inverse_t)
        spherical = pressure_mpa * volume
        stiffness: Array = (
            2 * slope[..., None, None, None, None] * unit
            + (self.shear_mpa - spherical)[..., None, None, None, None] * swapped
            + spherical[..., None, None, None, None] * outer
        )
        if curvature:
            stiffness += 4 * curvature * np.einsum("...iJ,...kL->...iJkL", gradient, gradient)
        return stiffness

    def _slopes(self, gradient: Array) -> tuple[Array, float]:
        """∂W/∂I1 (…) and ∂²W/∂I1²."""
        first = np.einsum("...iJ,...iJ->...", gradient, gradient) - 3
        c1 = self.shear_mpa / 2
        c2 = c1 * self.stiffening
        return c1 + 2 * c2 * first, 2 * c2
