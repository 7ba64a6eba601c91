"""Closest approach of two rays, and of every ray of one view to every ray of another."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    # Rays less than 1e-6 rad apart: their closest approach is rounding alone.
    slenderness = np.where(slenderness > 1e-12, slenderness, np.nan)
    reach_left = (along_left - cosine * along_right) / slenderness
    reach_right = (cosine * along_left - along_right) / slenderness
    on_left = reach_left[..., np.newaxis] * left
    on_right = reach_right[..., np.newaxis] * right
    middle = left_center + 0.5 * (on_left + on_right + base)
    return Approach(_dot(np.cross(left, right), base) / np.sqrt(slenderness), middle)


def _dot(first: Array, second: Array) -> Array:
    return (first * second).sum(axis=-1)
