"""Rotation from the object's frame into a camera's: R = Rκ·Rφ·Rω."""

import math

import numpy as np
from numpy.typing import NDArray


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
