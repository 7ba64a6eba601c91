"""Pattern of residuals: whether those of neighbouring targets agree, which noise does not make them do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from grabberd.core.calibration.adjustment.adjustment import Adjustment

Array = NDArray[np.float64]

_NEIGHBOURS = 4
_LEAST_IMAGES = 16


@dataclass(frozen=True, slots=True)
class Pattern:
    """Agreement of one view's neighbouring residuals.

    Attributes:
        view: Name of the view.
        correlation: Correlation of a residual with the mean of its neighbours' (Moran's I); 0 for noise.
        statistic: Its deviation from that of noise, in its own σ.
        rms_px: Root mean square of the residuals.
    """

    view: str
    correlation: float
    statistic: float
    rms_px: float


def residual_patterns(adjustment: Adjustment) -> tuple[Pattern, ...]:
    """Measure the agreement in each view that shows enough targets, x and y together."""
    views = enumerate(adjustment.views)
    return tuple(
        _pattern(view.name, adjustment, own)
        for index, view in views
        if (own := adjustment.network.view == index).sum() >= _LEAST_IMAGES
    )


def _pattern(name: str, adjustment: Adjustment, own: NDArray[np.bool_]) -> Pattern:
    xy, residual = adjustment.network.xy_px[own], adjustment.residual_px[own]
    near = np.asarray(cKDTree(xy).query(xy, k=_NEIGHBOURS + 1)[1])[:, 1:]
    centred = residual - residual.mean(axis=0)
    lag = centred[near].mean(axis=1)
    square = float((centred**2).sum())
    correlation = float((centred * lag).sum()) / square if square else 0.0
    # Under noise the mean of k neighbours has the variance 1/k, x and y are two samples.
    sigma = 1.0 / np.sqrt(_NEIGHBOURS * centred.size / 2)
    return Pattern(name, correlation, correlation / float(sigma), float(np.sqrt((residual**2).mean())))
