"""Stillness: how far the whole picture of the calibration frame moves from field to field.

A stand that sinks or trembles by a few tenths of a pixel passes for still target by target; all targets
together show it, since their noise averages out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.mean_images import FieldImages, MeanImages

Array = NDArray[np.float64]

_GATE_PX = 1.5
_LEAST_IMAGES = 8


@dataclass(frozen=True, slots=True)
class Stillness:
    """Movement of one view's picture during the capture.

    Attributes:
        rms_px: Root mean square of the fields' common shifts, in x and y.
        drift_px: Their steady change from the first field to the last.
    """

    rms_px: float
    drift_px: float


def stillness(fields: Sequence[FieldImages], means: MeanImages) -> Stillness:
    """Measure the movement of one view's picture; zero for fewer than three fields of a parity."""
    shifts = np.array([_shift(one, means) for one in fields]).reshape(-1, 2)
    parity = np.array([one.parity for one in fields])
    time = np.arange(len(fields), dtype=float)
    kept = np.isfinite(shifts).all(axis=1)
    for one in np.unique(parity):
        own = (parity == one) & kept
        # Each parity cuts the discs at other lines, which shifts all of them alike.
        if own.sum() < 3:
            kept &= ~own
        else:
            shifts[own] -= shifts[own].mean(axis=0)
    if not kept.any():
        return Stillness(0.0, 0.0)
    slope = np.polyfit(time[kept], shifts[kept], 1)[0]
    drift = float(np.linalg.norm(slope) * np.ptp(time[kept]))
    return Stillness(float(np.sqrt((shifts[kept] ** 2).sum(axis=1).mean())), drift)


def _shift(field: FieldImages, means: MeanImages) -> Array:
    """(2,) median displacement of a field's images from the means; NaN with too few of them."""
    between = np.linalg.norm(field.xy_px[:, np.newaxis] - means.xy_px, axis=2)
    if not between.size:
        return np.full(2, np.nan)
    nearest = between.argmin(axis=1)
    near = between[np.arange(len(nearest)), nearest] < _GATE_PX
    if near.sum() < _LEAST_IMAGES:
        return np.full(2, np.nan)
    median: Array = np.median(field.xy_px[near] - means.xy_px[nearest[near]], axis=0)
    return median
