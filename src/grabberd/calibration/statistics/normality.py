"""Whether residuals are distributed as errors should be: skewness, kurtosis, and a test of both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from grabberd.calibration.adjustment.adjustment import Adjustment

Array = NDArray[np.float64]

_FEWEST = 8


@dataclass(frozen=True, slots=True)
class Normality:
    """The shape of the distribution of standardised residuals.

    Attributes:
        of: name of the view, or "all".
        count: of residuals; those that nothing controls are not among them.
        skewness: 0 of a normal distribution; `kurtosis`: the excess, 0 of a normal distribution.
        statistic: Jarque and Bera's with the moments' variances for a finite sample (Urzúa 1996).
        p: of one so large where the distribution is normal; NaN for fewer than eight residuals.
    """

    of: str
    count: int
    skewness: float
    kurtosis: float
    statistic: float
    p: float


def normality(adjusted: Adjustment) -> tuple[Normality, ...]:
    """Of every view's residuals, x and y together, then of all."""
    standardised, view = adjusted.standardised, adjusted.network.view
    views = [
        normality_of(standardised[view == index].ravel(), one.name)
        for index, one in enumerate(adjusted.network.views)
    ]
    return *views, normality_of(standardised.ravel(), "all")


def normality_of(values: Array, of: str) -> Normality:
    """Of any values (N,); NaN among them does not count."""
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
