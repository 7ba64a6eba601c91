"""Conversions between this project's conventions and those of other programs: rotations and image frames.

Here the camera looks along −z with y up, `View.axes` lead from the object's frame into the camera's, and the
centre of the top left pixel is (0, 0) with y down.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry.view import rotation_matrix

Array = NDArray[np.float64]

HALF_TURN_ABOUT_X = np.diag([1.0, -1.0, -1.0])
"""From a camera that looks along −z with y up to one that looks along +z with y down, and back."""
_CORNER_PX = 0.5


def axes_from_omega_phi_kappa(omega_deg: float, phi_deg: float, kappa_deg: float) -> Array:
    """Convert ω, φ, κ of DBAT and PhotoModeler into axes (3, 3).

    They turn the coordinates about x, then the new y, then the new z, as here; PhotoModeler lists them in the
    opposite order.
    """
    omega, phi, kappa = np.radians([omega_deg, phi_deg, kappa_deg]).tolist()
    return rotation_matrix(omega, phi, kappa)


def axes_from_openptv(rotation: Sequence[Sequence[float]] | Array) -> Array:
    """Convert the matrix of an OpenPTV orientation file (3, 3), which leads from the camera to the object."""
    return np.asarray(rotation, np.float64).T.copy()


def pose_from_opencv(rotation: Array, translation_mm: Array) -> tuple[Array, Array]:
    """Convert a pose X_camera = R·X + t of a camera that looks along +z with y down (OpenCV, COLMAP).

    Args:
        rotation: (3, 3) R.
        translation_mm: (3,) t.

    Returns:
        Axes (3, 3) and the projection centre (3,) in the object's frame.
    """
    return HALF_TURN_ABOUT_X @ rotation, -rotation.T @ translation_mm


def pose_to_opencv(axes: Array, center_mm: Array) -> tuple[Array, Array]:
    """Convert axes (3, 3) and a projection centre (3,) into OpenCV's R (3, 3) and t (3,)."""
    rotation = HALF_TURN_ABOUT_X @ axes
    return rotation, -rotation @ center_mm


def pixels_from_corner(xy_px: Array) -> Array:
    """Convert pixels (N, 2) whose origin is the top left corner of the picture (OpenPTV, COLMAP), y down."""
    return xy_px - _CORNER_PX


def pixels_to_corner(xy_px: Array) -> Array:
    """Convert pixels (N, 2) into those whose origin is the top left corner of the picture."""
    return xy_px + _CORNER_PX


def pixels_from_sensor(xy_mm: Array, columns: int, lines: int, pixel_mm: tuple[float, float]) -> Array:
    """Convert sensor coordinates in mm, y up from the middle of the picture, into pixels; both (N, 2)."""
    middle = 0.5 * np.array([columns - 1, lines - 1])
    return np.asarray(middle + xy_mm * (1.0, -1.0) / np.asarray(pixel_mm), np.float64)


def pixels_to_sensor(xy_px: Array, columns: int, lines: int, pixel_mm: tuple[float, float]) -> Array:
    """Convert pixels into sensor coordinates in mm, y up from the middle of the picture; both (N, 2)."""
    middle = 0.5 * np.array([columns - 1, lines - 1])
    return np.asarray((xy_px - middle) * (1.0, -1.0) * np.asarray(pixel_mm), np.float64)
