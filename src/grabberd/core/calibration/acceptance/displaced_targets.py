"""Displaced targets: those that both views see elsewhere than the calibration frame's file has them.

Identification leaves out a target that is off by half a millimetre or more, the adjustment one that is off by
less; neither says where it really stands. The image points that are left over do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, View
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect

Array = NDArray[np.float64]

_MEET_PX = 0.5
"""Greatest RMS of the image coordinates of one target's two image points."""
_MARGIN_MM = 10.0
"""Distance from the other targets within which a left-over target may stand."""
_MOST_PAIRS = 2500
_SAME_MM = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class DisplacedTarget:
    """Target that stands elsewhere.

    Attributes:
        target: Index of the target.
        shift_mm: (3,) from its place in the file to where it stands.
    """

    target: int
    shift_mm: Array

    @property
    def distance_mm(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.shift_mm))


def displaced_targets(
    views: Sequence[View], frame: ObjectModel, missing: NDArray[np.intp], left_px: Array, right_px: Array
) -> tuple[DisplacedTarget, ...]:
    """Find where missing targets stand.

    Args:
        views: The calibrated left and right view.
        frame: The calibration frame.
        missing: Indices of the targets that neither view shows where they should be.
        left_px: (L, 2) image points of the left view that belong to no target.
        right_px: (R, 2) likewise of the right view.
    """
    places = _left_over(views, frame, left_px, right_px)
    if not len(missing) or not len(places):
        return ()
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy, and the daemon does without

    shift = places - frame.xyz_mm[missing, np.newaxis]
    rows, columns = linear_sum_assignment(np.linalg.norm(shift, axis=2))
    return tuple(DisplacedTarget(int(missing[i]), shift[i, j]) for i, j in zip(rows, columns, strict=True))


def swapped_axes(one: DisplacedTarget, other: DisplacedTarget, frame: ObjectModel) -> str:
    """Axes whose values two targets have swapped in the file, such as "z"; empty if they have not."""
    apart = frame.xyz_mm[other.target] - frame.xyz_mm[one.target]
    opposite = np.abs(one.shift_mm + other.shift_mm) < _SAME_MM
    moved = np.abs(one.shift_mm) >= _SAME_MM
    explained = ~moved | (np.abs(one.shift_mm - apart) < _SAME_MM)
    return "".join(np.array(list("xyz"))[moved]) if (opposite & explained).all() else ""


def _left_over(views: Sequence[View], frame: ObjectModel, left_px: Array, right_px: Array) -> Array:
    """(N, 3) places among the targets where the rays of two left-over image points meet."""
    first, second = (one.ravel() for one in np.indices((len(left_px), len(right_px))))
    if not 0 < len(first) <= _MOST_PAIRS:
        return np.empty((0, 3))
    left, right = (ViewBlobs(xy_px, np.ones_like(xy_px)) for xy_px in (left_px[first], right_px[second]))
    ids = np.arange(len(first), dtype=np.int32)
    found = intersect(Rig.of_views(views), ids, left, right, ImageNoise(0.0, 1, 1.0))
    low, high = frame.xyz_mm.min(axis=0) - _MARGIN_MM, frame.xyz_mm.max(axis=0) + _MARGIN_MM
    with np.errstate(invalid="ignore"):
        inside = ((found.xyz_mm >= low) & (found.xyz_mm <= high)).all(axis=1)
        places: Array = found.xyz_mm[inside & (found.residual_px < _MEET_PX)]
    return places
