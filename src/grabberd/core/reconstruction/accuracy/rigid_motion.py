"""Rigid motion that best maps one set of points onto another: rotation and shift, never scale."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError

Array = NDArray[np.float64]

_LEAST_EXTENT = 1e-3
"""Ratio of the second to the first principal extent below which points count as lying on one line."""


@dataclass(frozen=True, slots=True, eq=False)
class RigidMotion:
    """X' = R·X + t.

    Attributes:
        rotation: (3, 3), proper: a reflection is not a rigid motion.
        shift_mm: (3,) t.
    """

    rotation: Array
    shift_mm: Array

    def apply(self, xyz_mm: Array) -> Array:
        """Move points (…, 3)."""
        return xyz_mm @ self.rotation.T + self.shift_mm

    def turn(self, covariance_mm2: Array) -> Array:
        """Rotate covariances (…, 3, 3)."""
        return self.rotation @ covariance_mm2 @ self.rotation.T

    @property
    def angle_deg(self) -> float:
        """Angle of rotation, about whatever axis."""
        skew = self.rotation - self.rotation.T
        sine = 0.5 * math.sqrt(0.5 * float((skew * skew).sum()))
        return math.degrees(math.atan2(sine, 0.5 * (float(np.trace(self.rotation)) - 1.0)))


def rigid_motion(from_mm: Array, to_mm: Array) -> RigidMotion:
    """Fit the least-squares motion of N points onto N others (Kabsch 1976).

    Args:
        from_mm: (N, 3).
        to_mm: (N, 3), in the same order.

    Raises:
        MeasurementError: There are fewer than three points, or all lie on one line.
    """
    middle_from, middle_to = from_mm.mean(axis=0), to_mm.mean(axis=0)
    extent = np.linalg.svd(to_mm - middle_to, compute_uv=False) if len(to_mm) >= 3 else np.zeros(3)
    if extent[1] <= _LEAST_EXTENT * extent[0]:
        raise MeasurementError(
            f"{len(to_mm)} points on one line do not determine a rigid motion",
            "compare without a fit, or measure more targets",
        )
    u, _, vt = np.linalg.svd((from_mm - middle_from).T @ (to_mm - middle_to))
    # A determinant of −1 would be a reflection; turning the weakest direction costs the fit least.
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation: Array = (u @ proper @ vt).T
    return RigidMotion(rotation, middle_to - rotation @ middle_from)
