"""Normality of residuals: skewness, kurtosis, and a test of both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from grabberd.core.calibration.adjustment.adjustment import Adjustment

Array = NDArray[np.float64]

_FEWEST = 8


@dataclass(frozen=True, slots=True)
class Normality:
    """Shape of the distribution of standardised residuals.

    Attributes:
        of: Name of the view, or "all".
        count: Number of residuals, without uncontrolled ones.
        skewness: 0 for a normal distribution.
        kurtosis: Excess kurtosis, 0 for a normal distribution.
        statistic: Jarque–Bera statistic with finite-sample variances of the moments (Urzúa 1996).
        p: Probability of a statistic at least so large under normality; NaN for fewer than eight residuals.
    """

    of: str
    count: int
    skewness: float
    kurtosis: float
    statistic: float
    p: float


def normality(adjusted: Adjustment) -> tuple[Normality, ...]:
    """Test every view's residuals, x and y together, then all of them."""
    standardised, view = adjusted.standardised, adjusted.network.view
    views = [
        normality_of(standardised[view == index].ravel(), one.name)
        for index, one in enumerate(adjusted.network.views)
    ]
    return *views, normality_of(standardised.ravel(), "all")


def normality_of(values: Array, of: str) -> Normality:
    """Test any values (N,), ignoring NaN."""
    values = values[np.isfinite(values)]
    n = len(values)
    if n < _FEWEST or not np.ptp(values):
        return Normality(of, n, np.nan, np.nan, np.nan, np.nan)
    away = values - values.mean()
    spread = np.mean(away**2)
    skewness = float(np.mean(away**3) / spread**1.5)
    kurtosis = float(np.mean(away**4) / spread**2)
    expected = 3 * (n - 1) / (n + 1)
    variance = 24 * n * (n - 2) * (n - 3) / ((n + 1) ** 2 * (n + 3) * (n + 5))
    statistic = skewness**2 * (n + 1) * (n + 3) / (6 * (n - 2)) + (kurtosis - expected) ** 2 / variance
    return Normality(of, n, skewness, kurtosis - 3, statistic, float(chdtrc(2, statistic)))
