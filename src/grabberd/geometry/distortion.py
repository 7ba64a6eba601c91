"""What lens and mirrors add to the ideal point (paper eqs. 6 and 7).

With x, y reduced to the principal point and r² = x² + y²:

    dx = −b1 x + b2 y + x (b3 r² + b4 r⁴ + b5 r⁶) + b6 (r² + 2x²) + 2 b7 x y − b8 x y²
    dy = +b1 y + b2 x + y (b3 r² + b4 r⁴ + b5 r⁶) + 2 b6 x y + b7 (r² + 2y²) − b9 x² y

b1 is an affinity (with the equal signs that the paper prints it would be a scale, which f is already) and b9
stands apart from b8. The two equations are one another's mirror image under x ↔ y, so each is computed once
for both coordinates, on arrays whose first axis is (x, y).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Distortion:
    """The coefficients of V views, in the shapes that broadcast against (2, V, N) coordinates.

    Attributes:
        own: (2, V, 1), coefficient of a coordinate in its own equation: −b1, +b1.
        other: (V, 1), coefficient of the other coordinate: b2.
        radial: (3, V, 1), b3, b4, b5.
        decentering: (2, V, 1), b6, b7; `crosswise`: the same exchanged.
        mirror: (2, V, 1), b8, b9.
    """

    own: Array
    other: Array
    radial: Array
    decentering: Array
    crosswise: Array
    mirror: Array

    @classmethod
    def of(cls, b: Sequence[Sequence[float]]) -> "Distortion":
        """From b1…b9 of each of V views."""
        table = np.array(b, np.float64).T[:, :, np.newaxis]
        decentering = table[5:7]
        return cls(
            own=np.stack([-table[0], table[0]]),
            other=table[1],
            radial=table[2:5],
            decentering=decentering,
            crosswise=decentering[::-1].copy(),
            mirror=table[7:9],
        )

    def at(self, xy_mm: Array) -> Array:
        """(2, V, N) dx and dy in mm at the ideal points (2, V, N) in mm."""
        swapped = xy_mm[::-1]
        r2 = _squared_radius(xy_mm)
        b3, b4, b5 = self.radial
        proportion = r2 * (b3 + r2 * (b4 + r2 * b5)) + self.own
        proportion += 3.0 * self.decentering * xy_mm
        proportion += (2.0 * self.crosswise - self.mirror * swapped) * swapped
        added: Array = xy_mm * proportion + swapped * (self.other + self.decentering * swapped)
        return added

    def slopes(self, xy_mm: Array) -> tuple[Array, Array]:
        """Derivatives of the distortion at the ideal points (2, V, N), each (2, V, N).

        Returns:
            by the own coordinate (∂dx/∂x, ∂dy/∂y) and by the other one (∂dx/∂y, ∂dy/∂x).
        """
        swapped = xy_mm[::-1]
        r2 = _squared_radius(xy_mm)
        b3, b4, b5 = self.radial
        steepness = 2.0 * (b3 + r2 * (2.0 * b4 + r2 * (3.0 * b5)))
        own = r2 * (b3 + r2 * (b4 + r2 * b5)) + self.own + steepness * (xy_mm * xy_mm)
        own += 6.0 * self.decentering * xy_mm
        own += (2.0 * self.crosswise - self.mirror * swapped) * swapped
        other = (steepness - 2.0 * self.mirror) * (xy_mm[0] * xy_mm[1]) + self.other
        other += 2.0 * (self.decentering * swapped + self.crosswise * xy_mm)
        return own, other


def basis(xy_mm: Array) -> Array:
    """(2, V, 9, N): derivatives of dx and dy by b1…b9 at the ideal points (2, V, N) in mm."""
    x, y = xy_mm
    r2 = _squared_radius(xy_mm)
    zero = np.zeros_like(x)
    in_x = (-x, y, x * r2, x * r2**2, x * r2**3, r2 + 2 * x * x, 2 * x * y, -x * y * y, zero)
    in_y = (y, x, y * r2, y * r2**2, y * r2**3, 2 * x * y, r2 + 2 * y * y, zero, -x * x * y)
    return np.stack([np.stack(in_x, axis=1), np.stack(in_y, axis=1)])


def distortion(b: Sequence[float], xy_mm: Array) -> Array:
    """(N, 2) float64, dx and dy in mm at N ideal points (N, 2) in mm; b holds b1…b9 (paper eqs. 6 and 7)."""
    added = Distortion.of([b]).at(xy_mm.T[:, np.newaxis])
    return added[:, 0].T


def _squared_radius(xy_mm: Array) -> Array:
    radius: Array = xy_mm[0] * xy_mm[0] + xy_mm[1] * xy_mm[1]
    return radius
