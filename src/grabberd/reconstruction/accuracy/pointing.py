"""The precision of pointing: how repeated image coordinates of targets at rest differ (paper 3.5)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.accuracy.accuracy import pooled_variance
from grabberd.reconstruction.point_series import PointSeries

PAPER_PX = (0.170, 0.225)
"""x and y, from 32 measurements of 108 targets on the calibration frame."""


class PointingPrecision(NamedTuple):
    """Standard deviations in frame pixels, pooled over all targets.

    Attributes:
        fields: measurements; `targets`: that were measured at least twice.
        left_px: x, y in the left view; `right_px` in the right one; `both_px` of both views together.
    """

    fields: int
    targets: int
    left_px: tuple[float, float]
    right_px: tuple[float, float]
    both_px: tuple[float, float]


def pointing_precision(series: PointSeries) -> PointingPrecision | None:
    """The paper's precision test, of an object at rest; None where no target was measured twice.

    Fields of both parities count alike, so the errors of quantisation that differ between them are in it;
    those that they have in common are not.
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
