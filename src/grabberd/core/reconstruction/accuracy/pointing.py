"""Pointing precision: scatter of repeated image coordinates of targets at rest (paper 3.5)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.accuracy.accuracy import pooled_variance
from grabberd.core.reconstruction.point_series import PointSeries

PAPER_PX = (0.170, 0.225)
"""The paper's values in x and y, from 32 measurements of 108 targets on the calibration frame."""


class PointingPrecision(NamedTuple):
    """Standard deviations in frame pixels, pooled over all targets.

    Attributes:
        fields: Number of measurements.
        targets: Number of targets measured at least twice.
        left_px: x, y in the left view.
        right_px: x, y in the right view.
        both_px: x, y in both views together.
    """

    fields: int
    targets: int
    left_px: tuple[float, float]
    right_px: tuple[float, float]
    both_px: tuple[float, float]


def pointing_precision(series: PointSeries) -> PointingPrecision | None:
    """Run the paper's precision test on an object at rest; None if no target was measured twice.

    Fields of both parities count alike, so quantisation errors that differ between them are included; those
    they share are not.
    """
    field, target = np.nonzero(series.seen)
    image = series.image_px[field, target].reshape(-1, 4)
    variance, freedom = pooled_variance(target, image)
    if not freedom:
        return None
    left, right = variance[:2], variance[2:]
    return PointingPrecision(
        fields=len(series.n),
        targets=int((series.seen.sum(axis=0) > 1).sum()),
        left_px=_sigma(left),
        right_px=_sigma(right),
        both_px=_sigma(0.5 * (left + right)),
    )


def _sigma(variance: NDArray[np.float64]) -> tuple[float, float]:
    x, y = np.sqrt(variance).tolist()
    return x, y
