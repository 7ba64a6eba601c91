"""A value from a fit that answers a question: a mean, a difference, a slope."""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit

LEVEL = 0.95
"""Probability of the intervals."""


class Contrast(NamedTuple):
    """Combination of a model's coefficients.

    Attributes:
        value: what it is.
        sigma: one standard deviation, by the scatter of the observations and by what they share.
        common: part of `sigma` that is shared, which no number of observations lessens.
        dof: degrees of freedom of `sigma` after Welch and Satterthwaite, `common` counting as known; NaN
            where there is no scatter to judge by: then `sigma` is that of the measurements alone.
        by_sigma: True if the measurements' own σ decides, since the scatter is smaller, or there is none.
    """

    value: float
    sigma: float
    common: float
    dof: float
    by_sigma: bool

    @property
    def t(self) -> float:
        """The value by its σ; NaN where nothing can be tested."""
        return self.value / self.sigma if np.isfinite(self.dof) and self.sigma > 0 else np.nan

    @property
    def p(self) -> float:
        """Probability of a value at least as far from 0, if it were 0; NaN where nothing can be tested."""
        return float(2.0 * stdtr(self.dof, -abs(self.t))) if np.isfinite(self.t) else np.nan

    @property
    def half_width(self) -> float:
        """Half the 95 % interval; NaN where nothing can be tested."""
        return float(stdtrit(self.dof, 0.5 + LEVEL / 2) * self.sigma) if np.isfinite(self.dof) else np.nan


def contrast(value: float, by_scatter: tuple[float, float], own: float, common: float) -> Contrast:
    """A contrast from the parts of its σ.

    Args:
        value: what it is.
        by_scatter: its variance by the scatter of the observations and the degrees of freedom of that; NaN
            where the observations have none to spare.
        own: its variance by the observations' own σ; NaN where that is not known.
        common: its σ by what they share.
    """
    scatter, dof = by_scatter
    by_sigma = not scatter >= own if np.isfinite(own) else not np.isfinite(scatter)
    independent = own if by_sigma else scatter
    variance = independent + common**2
    if by_sigma and not np.isfinite(scatter):
        return Contrast(value, float(np.sqrt(variance)), common, np.nan, True)
    # With the scatter's freedom even where σ decides: a small scatter is no proof that σ is right.
    total = np.inf if independent == 0 else dof * (variance / independent) ** 2
    return Contrast(value, float(np.sqrt(variance)), common, float(total), by_sigma)
