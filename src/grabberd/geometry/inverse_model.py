"""Inverse model: from frame pixels back to the ideal point and its ray (inverse of paper eqs. 4–7),
and the closest approach of two rays.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry.functional_model import image, single
from grabberd.geometry.rig import Rig
from grabberd.geometry.view import View

Array = NDArray[np.float64]

TOLERANCE_MM = 1e-10
"""Length of the last step below which an ideal point counts as found."""
_MOST_STEPS = 30


def correct(view: View, xy_px: Array) -> Array:
    """Compute ideal points from observed ones: distortion removed, reduced to the principal point.

    Newton's iteration until its step is below `TOLERANCE_MM`, never a single step.

    Args:
        view: View that they were observed in.
        xy_px: (N, 2) float64, frame pixels.

    Returns:
        (N, 2) float64, mm, y up. NaN where the iteration does not converge, or converges beyond the fold of
        the distortion, where no object point can be seen; NaN in gives NaN out.
    """
    return correct_all(single(view), xy_px.T[:, np.newaxis])[:, 0].T


def rays(view: View, xy_px: Array) -> tuple[Array, Array]:
    """Compute the rays on which observed points lie.

    Returns:
        The projection centre (3,) in mm and unit vectors (N, 3) from it toward the object, both in the
        object's frame; NaN where `correct` gives NaN.
    """
    directions = directions_all(single(view), correct_all(single(view), xy_px.T[:, np.newaxis]))
    return view.center_mm, directions[0].T


def correct_all(rig: Rig, xy_px: Array) -> Array:
    """Apply `correct` to all views of a rig at once: (2, V, N) frame pixels to (2, V, N) mm."""
    ideal = (xy_px - rig.origin_px) * rig.pixel_mm
    upright = np.sign(rig.pixel_mm[0] * rig.pixel_mm[1])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(_MOST_STEPS):
            step, area = _newton_step(rig, ideal, xy_px)
            ideal -= step
            unsettled = ~(np.abs(step).max(axis=0) < TOLERANCE_MM)
            if not (unsettled & np.isfinite(area)).any():
                break
        ideal[:, unsettled | ~(area * upright > 0.0)] = np.nan
    return ideal


def directions_all(rig: Rig, ideal_mm: Array) -> Array:
    """(V, 3, N) unit vectors in the object's frame, from the cameras through the ideal points (2, V, N)."""
    _, views, count = ideal_mm.shape
    camera = np.empty((views, 3, count))
    camera[:, :2] = ideal_mm.swapaxes(0, 1)
    camera[:, 2] = -rig.f_mm
    camera /= np.sqrt((camera * camera).sum(axis=1, keepdims=True))
    turned: Array = rig.rotation.swapaxes(1, 2) @ camera
    return turned


def _newton_step(rig: Rig, ideal: Array, observed_px: Array) -> tuple[Array, Array]:
    """The step (2, V, N) in mm, and the slopes' determinant (V, N), whose sign changes at the fold."""
    seen = image(rig, ideal)
    excess = seen.pixels - observed_px
    area = seen.own[0] * seen.own[1] - seen.other[0] * seen.other[1]
    return (excess * seen.own[::-1] - seen.other * excess[::-1]) / area, area


class Approach(NamedTuple):
    """Closest approach of pairs of rays.

    Attributes:
        distance_mm: (…) shortest distance, signed: positive if the right ray passes on the side of left
            direction × right direction.
        middle_mm: (…, 3) middle of the shortest connection.
    """

    distance_mm: Array
    middle_mm: Array


def approach(left_center: Array, left: Array, right_center: Array, right: Array) -> Approach:
    """Compute the closest approach of rays; (N, 1, 3) directions against (1, M, 3) compare every pair.

    Args:
        left_center: (3,) mm, object's frame.
        left: (…, 3) unit vectors from it.
        right_center: (3,) mm.
        right: (…, 3) unit vectors from it.

    Returns:
        Distances and middles; NaN for parallel rays. Two rays of the same object point pass at distance 0:
        the epipolar condition in mm.
    """
    base = right_center - left_center
    cosine = _dot(left, right)
    along_left, along_right = _dot(left, base), _dot(right, base)
    slenderness = 1.0 - cosine * cosine
    slenderness = np.where(slenderness > 1e-12, slenderness, np.nan)
    reach_left = (along_left - cosine * along_right) / slenderness
    reach_right = (cosine * along_left - along_right) / slenderness
    on_left = reach_left[..., np.newaxis] * left
    on_right = reach_right[..., np.newaxis] * right
    middle = left_center + 0.5 * (on_left + on_right + base)
    return Approach(_dot(np.cross(left, right), base) / np.sqrt(slenderness), middle)


def _dot(first: Array, second: Array) -> Array:
    product: Array = (first * second).sum(axis=-1)
    return product
