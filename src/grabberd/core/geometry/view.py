"""View: one virtual camera, as the parameters of the functional model, with its rotation and distortion.

The distortion by lens and mirrors is added to the ideal point (paper eqs. 6 and 7); other programs state the
correction to be added to the observed point, by the same equations.

With x, y reduced to the principal point and r² = x² + y²:

    dx = −b1 x + b2 y + x (b3 r² + b4 r⁴ + b5 r⁶) + b6 (r² + 2x²) + 2 b7 x y − b8 x y²
    dy = +b1 y + b2 x + y (b3 r² + b4 r⁴ + b5 r⁶) + 2 b6 x y + b7 (r² + 2y²) − b9 x² y

b1 is an affinity (with equal signs, as printed in the paper, it would be a scale, which f already is) and b9
is separate from b8. For speed the equations and their slopes are kept as a table over fifteen monomials:

    dx = x·P + y·Q,  dy = y·P + x·Q;  ∂dx/∂x, ∂dy/∂y = S;  ∂dx/∂y, ∂dy/∂x = T   (each for x and for y)

so that a few products and one matrix multiplication give everything, for all points of all views.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from grabberd.core.arrays import Array, Mask

PARAMETERS = (
    "f_mm",
    "x0_px",
    "y0_px",
    "omega_rad",
    "phi_rad",
    "kappa_rad",
    "X0_mm",
    "Y0_mm",
    "Z0_mm",
    *(f"b{i}" for i in range(1, 10)),
)
"""The 18 parameters of a view that an adjustment may estimate, in the order of vectors and covariances."""
Polynomial = Literal["distortion", "correction"]
_ONE, _X, _Y, _XX, _YY, _XY, _R2, _R4, _R6, _XX2, _YY2, _XY2, _XX4, _YY4, _XY4 = range(15)
"""Indices of the monomials; x²r² is _XX2, x²r⁴ is _XX4."""


@dataclass(frozen=True, slots=True)
class View:
    """A virtual camera: one half of the picture (paper eqs. 4–7, with b1 an affinity and b8, b9 separate).

    Attributes:
        name: "left" or "right".
        first_column: First frame column of its half.
        end_column: The frame column after its last.
        pixel_x_mm: Pixel pitch along a line.
        pixel_y_mm: Pitch from frame line to frame line.
        handedness: +1, or −1 if an odd number of mirrors makes the virtual camera left-handed.
        f_mm: Focal length (principal distance).
        x0_px, y0_px: Principal point, frame pixels.
        omega_rad, phi_rad, kappa_rad: Rotation, R = Rκ·Rφ·Rω.
        X0_mm, Y0_mm, Z0_mm: Projection centre in the object's frame.
        b: b1…b9 in 1, 1, mm⁻², mm⁻⁴, mm⁻⁶, mm⁻¹, mm⁻¹, mm⁻², mm⁻².
        polynomial: Meaning of equations (6) and (7): the distortion, added to the ideal point, or the
            correction, added to the observed one. Neither can be converted into the other exactly.
    """

    name: str
    first_column: int
    end_column: int
    pixel_x_mm: float
    pixel_y_mm: float
    handedness: int
    f_mm: float
    x0_px: float
    y0_px: float
    omega_rad: float
    phi_rad: float
    kappa_rad: float
    X0_mm: float
    Y0_mm: float
    Z0_mm: float
    b: tuple[float, ...] = (0.0,) * 9
    polynomial: Polynomial = "distortion"

    def vector(self) -> Array:
        """(18,) float64, the values of `PARAMETERS`."""
        return np.array([*(getattr(self, name) for name in PARAMETERS[:9]), *self.b])

    def with_vector(self, values: Array) -> "View":
        """Copy the view with other parameters; values (18,) in the order of `PARAMETERS`."""
        numbers = [float(value) for value in values]
        changes: dict[str, Any] = dict(zip(PARAMETERS[:9], numbers, strict=False))
        return replace(self, **changes, b=tuple(numbers[9:]))

    @property
    def center_mm(self) -> Array:
        """(3,) float64, projection centre in the object's frame."""
        return np.array([self.X0_mm, self.Y0_mm, self.Z0_mm])

    @property
    def axes(self) -> Array:
        """(3, 3) float64, from the object's frame into the camera's, handedness included."""
        rotation = rotation_matrix(self.omega_rad, self.phi_rad, self.kappa_rad)
        return np.diag([self.handedness, 1.0, 1.0]) @ rotation

    def with_axes(self, axes: Array) -> "View":
        """Copy the view with other `axes` (3, 3), whose determinant gives the handedness."""
        handedness = 1 if np.linalg.det(axes) > 0 else -1
        omega, phi, kappa = rotation_angles(np.diag([handedness, 1.0, 1.0]) @ axes)
        return replace(self, handedness=handedness, omega_rad=omega, phi_rad=phi, kappa_rad=kappa)

    def holds(self, xy_px: Array) -> Mask:
        """(N,) bool: True for frame pixels (N, 2) in this view's half of the picture."""
        x = xy_px[:, 0]
        return (x >= self.first_column - 0.5) & (x < self.end_column - 0.5)


def rotation_matrix(omega_rad: float, phi_rad: float, kappa_rad: float) -> Array:
    """Compute R = Rκ·Rφ·Rω, which rotates coordinates from the object's frame into the camera's.

    A single-axis matrix turns the *axes* counterclockwise by its angle: Rω = [[1, 0, 0], [0, cos, sin],
    [0, −sin, cos]], Rφ = [[cos, 0, −sin], [0, 1, 0], [sin, 0, cos]], Rκ = [[cos, sin, 0], [−sin, cos, 0],
    [0, 0, 1]].

    Returns:
        (3, 3) float64, orthogonal with determinant +1.
    """
    return _turn(2, kappa_rad) @ _turn(1, phi_rad) @ _turn(0, omega_rad)


def rotation_derivatives(omega_rad: float, phi_rad: float, kappa_rad: float) -> Array:
    """(3, 3, 3) float64 derivatives of R by ω, φ and κ, stacked along the first axis."""
    about_x, about_y, about_z = _turn(0, omega_rad), _turn(1, phi_rad), _turn(2, kappa_rad)
    return np.stack(
        [
            about_z @ about_y @ _turn_rate(0, omega_rad),
            about_z @ _turn_rate(1, phi_rad) @ about_x,
            _turn_rate(2, kappa_rad) @ about_y @ about_x,
        ]
    )


def rotation_angles(rotation: Array) -> tuple[float, float, float]:
    """Extract ω, φ, κ from a rotation matrix (3, 3); φ lies in [−π/2, π/2].

    At φ = ±π/2 only the sum or the difference of ω and κ is determined; κ is then set to zero.
    """
    phi = math.atan2(rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if abs(rotation[0, 0]) < 1e-12 and abs(rotation[1, 0]) < 1e-12:
        return math.atan2(rotation[1, 2], rotation[1, 1]), phi, 0.0
    return math.atan2(-rotation[2, 1], rotation[2, 2]), phi, math.atan2(-rotation[1, 0], rotation[0, 0])


def _turn(axis: int, angle_rad: float) -> Array:
    return _about(axis, math.cos(angle_rad), math.sin(angle_rad), along=1.0)


def _turn_rate(axis: int, angle_rad: float) -> Array:
    return _about(axis, -math.sin(angle_rad), math.cos(angle_rad), along=0.0)


def _about(axis: int, cosine: float, sine: float, along: float) -> Array:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[axis, axis] = along
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = sine, -sine
    return matrix


def polynomials(b: Sequence[float]) -> Array:
    """(4, 2, 15) coefficients of the polynomials P, Q, S, T, each for dx and for dy."""
    return np.tensordot(b, _OF_EACH, axes=1)


def _written_out(b: Sequence[float]) -> Array:
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = b
    radial = {_R2: b3, _R4: b4, _R6: b5}
    return np.array(
        [
            [
                _row({_ONE: -b1, _X: 3 * b6, _Y: 2 * b7, _YY: -b8, **radial}),
                _row({_ONE: +b1, _Y: 3 * b7, _X: 2 * b6, _XX: -b9, **radial}),
            ],
            [_row({_ONE: b2, _Y: b6}), _row({_ONE: b2, _X: b7})],
            [
                _row({_ONE: -b1, _X: 6 * b6, _Y: 2 * b7, _YY: -b8, **radial, **_steep(_XX, _XX2, _XX4, b)}),
                _row({_ONE: +b1, _Y: 6 * b7, _X: 2 * b6, _XX: -b9, **radial, **_steep(_YY, _YY2, _YY4, b)}),
            ],
            [
                _row({_ONE: b2, _Y: 2 * b6, _X: 2 * b7, **_steep(_XY, _XY2, _XY4, b), _XY: 2 * (b3 - b8)}),
                _row({_ONE: b2, _X: 2 * b7, _Y: 2 * b6, **_steep(_XY, _XY2, _XY4, b), _XY: 2 * (b3 - b9)}),
            ],
        ]
    )


def monomials(xy_mm: Array) -> Array:
    """Evaluate the monomials, (V, 15, N), at points (2, V, N) in mm."""
    _, views, count = xy_mm.shape
    powers = np.empty((15, views, count))
    powers[_ONE] = 1.0
    powers[_X:_XX] = xy_mm
    np.multiply(xy_mm, xy_mm, out=powers[_XX:_XY])
    np.multiply(xy_mm[0], xy_mm[1], out=powers[_XY])
    r2 = np.add(powers[_XX], powers[_YY], out=powers[_R2])
    r4 = np.multiply(r2, r2, out=powers[_R4])
    np.multiply(r4, r2, out=powers[_R6])
    np.multiply(powers[_XX:_R2], r2, out=powers[_XX2:_XX4])
    np.multiply(powers[_XX:_R2], r4, out=powers[_XX4:])
    return powers.swapaxes(0, 1)


def distortion(b: Sequence[float], xy_mm: Array) -> Array:
    """(N, 2) float64, dx and dy in mm at N points (N, 2) in mm; b holds b1…b9 (paper eqs. 6 and 7)."""
    at = xy_mm.T
    own, other, _, _ = np.tensordot(polynomials(b), monomials(at[:, np.newaxis])[0], axes=1)
    added: Array = at * own + at[::-1] * other
    return added.T


def basis(xy_mm: Array) -> Array:
    """(2, V, 9, N) derivatives of dx and dy by b1…b9 at points (2, V, N) in mm."""
    x, y = xy_mm
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    table = np.zeros((*xy_mm.shape[:2], 9, xy_mm.shape[2]))
    table[0, :, 0], table[1, :, 0] = -x, y
    table[:, :, 1] = xy_mm[::-1]
    table[:, :, 2] = xy_mm * r2
    table[:, :, 3] = table[:, :, 2] * r2
    table[:, :, 4] = table[:, :, 3] * r2
    table[0, :, 5], table[1, :, 6] = r2 + 2 * xx, r2 + 2 * yy
    table[1, :, 5] = table[0, :, 6] = 2 * xy
    table[0, :, 7], table[1, :, 8] = -x * yy, -xx * y
    return table


def _steep(square: int, fourth: int, sixth: int, b: Sequence[float]) -> dict[int, float]:
    """Slope terms of the radial series, added to the series itself; `square` is x², y² or xy."""
    return {square: 2 * b[2], fourth: 4 * b[3], sixth: 6 * b[4]}


def _row(terms: dict[int, float]) -> Array:
    row = np.zeros(15)
    row[list(terms)] = list(terms.values())
    return row


_OF_EACH = np.array([_written_out(one) for one in np.eye(9).tolist()])
"""(9, 4, 2, 15) polynomials of each unit coefficient: they are linear in b1…b9."""
