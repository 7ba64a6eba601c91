"""Parallax: the contradiction of a target's two images, the only evidence two views give on their
calibration.

Four image coordinates determine three coordinates of a point; the remaining one is its *parallax*, the number
of frame lines by which the two images lie too high and too low across their epipolar lines. Anything that
moves the images along these lines, or both alike, looks like a point at another position.
"""

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, linearise, parameter_slopes
from grabberd.reconstruction.points import Points

Array = NDArray[np.float64]


def parallax(rig: Rig, points: Points) -> tuple[Array, Array]:
    """Compute the parallax and image residuals of N points.

    To first order, the position of the point along its rays does not matter.

    Returns:
        (N,) parallax in frame lines, positive if the left image lies too low relative to the right one; and
        (N, 2, 2) observed minus computed image in px: point, view, (x, y).
    """
    computed, slopes = linearise(rig, points.xyz_mm)
    residual = points.image_px.transpose(2, 1, 0) - computed
    return (_across(slopes) * residual).sum(axis=(0, 1)), residual.transpose(2, 1, 0)


def parallax_of_calibration(rig: Rig, xyz_mm: Array) -> Array:
    """(N, K) change of the parallax of points (N, 3) by 1 σ of K independent calibration errors."""
    if rig.factor is None:
        return np.zeros((len(xyz_mm), 0))
    across = _across(linearise(rig, xyz_mm)[1])
    moved = rig.factor.swapaxes(1, 2) @ parameter_slopes(rig, xyz_mm)
    shares: Array = (across[:, :, np.newaxis] * moved).sum(axis=(0, 1)).T
    return shares


def _across(slopes: Array) -> Array:
    """(2, 2, N) weight of every image coordinate in the parallax, which no movement of the point changes.

    Args:
        slopes: (2, 2, 3, N) derivatives of the image coordinates by X, Y, Z: coordinate, view.
    """
    rows = slopes.transpose(3, 0, 1, 2).reshape(-1, 4, 3)
    of_three = -np.linalg.solve(rows[:, :3].swapaxes(1, 2), rows[:, 3, :, np.newaxis])[:, :, 0]
    whole = np.concatenate([of_three, np.ones((len(rows), 1))], axis=1)
    scaled = whole * (2.0 / (whole[:, 2] - whole[:, 3]))[:, np.newaxis]
    across: Array = scaled.T.reshape(2, 2, -1)
    return across
