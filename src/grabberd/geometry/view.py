"""View: one virtual camera, as the parameters of the functional model."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

    def vector(self) -> NDArray[np.float64]:
        """(18,) float64, the values of `PARAMETERS`."""
        return np.array([*(getattr(self, name) for name in PARAMETERS[:9]), *self.b])

    def with_vector(self, values: NDArray[np.float64]) -> "View":
        """Copy the view with other parameters; values (18,) in the order of `PARAMETERS`."""
        numbers = [float(value) for value in values]
        changes: dict[str, Any] = dict(zip(PARAMETERS[:9], numbers, strict=False))
        return replace(self, **changes, b=tuple(numbers[9:]))

    @property
    def center_mm(self) -> NDArray[np.float64]:
        """(3,) float64, projection centre in the object's frame."""
        return np.array([self.X0_mm, self.Y0_mm, self.Z0_mm])

    def holds(self, xy_px: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) bool: True for frame pixels (N, 2) in this view's half of the picture."""
        x = xy_px[:, 0]
        return (x >= self.first_column - 0.5) & (x < self.end_column - 0.5)


def rotation_matrix(omega_rad: float, phi_rad: float, kappa_rad: float) -> NDArray[np.float64]:
    """Compute R = Rκ·Rφ·Rω, which rotates coordinates from the object's frame into the camera's.

    A single-axis matrix turns the *axes* counterclockwise by its angle: Rω = [[1, 0, 0], [0, cos, sin],
    [0, −sin, cos]], Rφ = [[cos, 0, −sin], [0, 1, 0], [sin, 0, cos]], Rκ = [[cos, sin, 0], [−sin, cos, 0],
    [0, 0, 1]].

    Returns:
        (3, 3) float64, orthogonal with determinant +1.
    """
    return _turn(2, kappa_rad) @ _turn(1, phi_rad) @ _turn(0, omega_rad)


def rotation_derivatives(omega_rad: float, phi_rad: float, kappa_rad: float) -> NDArray[np.float64]:
    """(3, 3, 3) float64 derivatives of R by ω, φ and κ, stacked along the first axis."""
    about_x, about_y, about_z = _turn(0, omega_rad), _turn(1, phi_rad), _turn(2, kappa_rad)
    return np.stack(
        [
            about_z @ about_y @ _turn_rate(0, omega_rad),
            about_z @ _turn_rate(1, phi_rad) @ about_x,
            _turn_rate(2, kappa_rad) @ about_y @ about_x,
        ]
    )


def rotation_angles(rotation: NDArray[np.float64]) -> tuple[float, float, float]:
    """Extract ω, φ, κ from a rotation matrix (3, 3); φ lies in [−π/2, π/2].

    At φ = ±π/2 only the sum or the difference of ω and κ is determined; κ is then set to zero.
    """
    phi = math.atan2(rotation[2, 0], math.hypot(rotation[0, 0], rotation[1, 0]))
    if abs(rotation[0, 0]) < 1e-12 and abs(rotation[1, 0]) < 1e-12:
        return math.atan2(rotation[1, 2], rotation[1, 1]), phi, 0.0
    return (
        math.atan2(-rotation[2, 1], rotation[2, 2]),
        phi,
        math.atan2(-rotation[1, 0], rotation[0, 0]),
    )


def _turn(axis: int, angle_rad: float) -> NDArray[np.float64]:
    return _about(axis, math.cos(angle_rad), math.sin(angle_rad), along=1.0)


def _turn_rate(axis: int, angle_rad: float) -> NDArray[np.float64]:
    return _about(axis, -math.sin(angle_rad), math.cos(angle_rad), along=0.0)


def _about(axis: int, cosine: float, sine: float, along: float) -> NDArray[np.float64]:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[axis, axis] = along
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = sine, -sine
    return matrix
