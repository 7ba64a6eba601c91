"""What the wall closes on: a compliant teat, and the opposite wall.

Both push back with a pressure that depends on a position alone, normal to the wall's inner face. A teat is
a bed of springs below a surface of revolution: a tapering barrel with a cap whose height and squareness
make it round, blunt or pointed. Lengths are in mm, pressure in MPa.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Over this depth a spring's stiffness grows from zero, so that Newton's steps see contact come.
_SOFT_START_MM = 0.05
_OPPOSITE_WALL_MPA_PER_MM = 0.5
"""Stiff against 50 kPa: walls that touch then overlap by a tenth of a millimetre."""
_AXIS_MM2 = 1e-6  # keeps the distance from the axis smooth on the axis itself


@dataclass(frozen=True, slots=True)
class Teat:
    """A teat from the mouthpiece, at low x, to its end.

    Attributes:
        name: Name in the tables.
        radius_mm: Radius of the barrel where its cap begins.
        end_x_mm: Position of its end along the liner's axis.
        cap_mm: Height of the cap; `squareness`: exponent of its outline, 2 for an ellipse.
        taper: Growth of the radius per length towards the udder.
        stiffness_mpa_per_mm: Pressure per depth at the surface.
        firm_mm: Depth at which the pressure is twice what that stiffness gives: tissue yields at first and
            hardly at all once it is squeezed.
        y_mm: Place of its axis beside the liner's, across the line of sight; `z_mm`: towards the cameras.
    """

    name: str
    radius_mm: float
    end_x_mm: float
    cap_mm: float
    squareness: float = 2.0
    taper: float = 0.02
    stiffness_mpa_per_mm: float = 0.012
    firm_mm: float = 5.0
    y_mm: float = 0.0
    z_mm: float = 0.0

    def pressure(self, points_mm: Array) -> tuple[Array, Array]:
        """Pressure (…) at points (…, 3), and its gradient (…, 3)."""
        base = self.end_x_mm - self.cap_mm
        off = points_mm[..., 1:] - np.array([self.y_mm, self.z_mm])
        distance = np.sqrt((off**2).sum(axis=-1) + _AXIS_MM2)
        below = np.maximum(points_mm[..., 0] - base, 0.0) / self.cap_mm
        above = np.maximum(base - points_mm[..., 0], 0.0)
        radius = self.radius_mm + self.taper * above
        m = self.squareness
        ratio = distance / radius
        outline = (below**m + ratio**m) ** (1 / m)
        scale = outline ** (1 - m)
        by_ratio = scale * ratio ** (m - 1)
        by_x = scale * below ** (m - 1) / self.cap_mm + by_ratio * ratio / radius * self.taper * (above > 0)
        by_off = (by_ratio / radius / distance)[..., np.newaxis] * off
        slope = np.concatenate([by_x[..., np.newaxis], by_off], axis=-1)
        depth = self.radius_mm * (1 - outline)
        pressure, stiffness = _spring(depth, self.stiffness_mpa_per_mm, self.firm_mm)
        return pressure, -stiffness[..., np.newaxis] * self.radius_mm * slope


def opposite_wall(points_mm: Array, side: Array | float = 1.0) -> tuple[Array, Array]:
    """Pressure (…) of the halves on each other, which meet in the plane z = 0, and its gradient (…, 3).

    Args:
        points_mm: (…, 3) points.
        side: (…) 1 for points of the upper half, -1 for those of the lower one.
    """
    pressure, stiffness = _spring(-side * points_mm[..., 2], _OPPOSITE_WALL_MPA_PER_MM, np.inf)
    gradient = np.zeros_like(points_mm)
    gradient[..., 2] = -side * stiffness
    return pressure, gradient


def _spring(depth_mm: Array, stiffness: float, firm_mm: float) -> tuple[Array, Array]:
    """Pressure k d (1 + (d/firm)²) with a soft start, and its derivative by the depth d."""
    soft = np.clip(depth_mm, 0.0, _SOFT_START_MM)
    by_depth = soft / _SOFT_START_MM
    deep = soft**2 / (2 * _SOFT_START_MM) + np.maximum(depth_mm - _SOFT_START_MM, 0.0)
    pressure = stiffness * deep * (1 + (deep / firm_mm) ** 2)
    return pressure, stiffness * by_depth * (1 + 3 * (deep / firm_mm) ** 2)
