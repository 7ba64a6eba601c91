"""Agreement of two methods of measurement: bias and limits of agreement after Bland and Altman, with the σ
that each method states of itself.

J. M. Bland, D. G. Altman: Statistical methods for assessing agreement between two methods of clinical
measurement, Lancet 327 (1986) 307–310; Measuring agreement in method comparison studies, Statistical Methods
in Medical Research 8 (1999) 135–160. Both take the differences for independent and equally certain. Those of
places on one teat are neither, so their covariance is used; if it is a multiple of unity, all is as theirs.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, stdtrit

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Joint

LIMIT = 1.96
"""σ on both sides of the mean between which 95 % of the differences lie."""
_OUTSIDE = 0.05
_LEAST_SPREAD = 1e-9


class Limit(NamedTuple):
    """A limit of agreement, with the ends of its 95 % confidence interval."""

    value: float
    low: float
    high: float


class Agreement(NamedTuple):
    """Result of N differences, of the first method less the second.

    Attributes:
        places: N.
        bias: mean difference; σ from those of both methods, enlarged if the differences scatter more.
        bias_low, bias_high: its 95 % confidence interval.
        sd: standard deviation of the differences; `expected_sd`: what the σ of both let expect.
        lower, upper: 95 % limits of agreement.
        independent: degrees of freedom of the standard deviation: N − 1 if the differences were independent.
        slope: of the difference on the mean of both methods: 0 unless the bias is proportional.
        chi2: of the differences about their weighted mean, with `dof`; `p`: probability of a larger one if
            the σ of both explain them.
    """

    places: int
    bias: Estimate
    bias_low: float
    bias_high: float
    sd: float
    expected_sd: float
    lower: Limit
    upper: Limit
    independent: float
    slope: Estimate
    chi2: float
    dof: int
    p: float


def agreement(difference: Joint, first: Joint, second: Estimate, chi2: float, dof: int) -> Agreement:
    """Judge the agreement.

    Args:
        difference: (N,) first method less second, with what registration adds in its covariance.
        first: (N,) the first method.
        second: (N,) the second one, with independent errors.
        chi2: of the differences about their weighted mean.
        dof: its degrees of freedom.

    Raises:
        AnalysisError: the differences are fewer than three.
    """
    count = len(difference.value)
    if count < 3 or dof < 1:
        raise AnalysisError(f"{count} differences say nothing of agreement", "compare more places")
    centre = np.eye(count) - 1 / count
    about_mean = centre @ difference.covariance @ centre
    expected = float(np.trace(about_mean)) / (count - 1)
    independent = float(np.trace(about_mean) ** 2 / np.sum(about_mean**2))
    sd = float(np.std(difference.value, ddof=1))
    # What scatters more than its σ is taken for as much less certain, as Birge does.
    larger = max(1.0, sd**2 / expected)
    bias = Estimate.of(difference.value.mean(), np.sqrt(larger * difference.covariance.mean()))
    reach = float(stdtrit(independent, 1 - _OUTSIDE / 2))
    of_limit = float(np.hypot(bias.sigma, LIMIT * sd / np.sqrt(2 * independent)))
    lower, upper = (
        Limit(at, at - reach * of_limit, at + reach * of_limit)
        for at in (float(bias.value) + side * LIMIT * sd for side in (-1, 1))
    )
    return Agreement(
        places=count,
        bias=bias,
        bias_low=float(bias.value - reach * bias.sigma),
        bias_high=float(bias.value + reach * bias.sigma),
        sd=sd,
        expected_sd=float(np.sqrt(expected)),
        lower=lower,
        upper=upper,
        independent=independent,
        slope=_slope(difference, first, second, larger),
        chi2=chi2,
        dof=dof,
        p=float(chdtrc(dof, chi2)),
    )


def _slope(difference: Joint, first: Joint, second: Estimate, larger: float) -> Estimate:
    """Slope of the difference on the mean.

    The less certain method is in the mean with half its errors and in the difference with all of them: that
    alone makes a slope, which is taken away.
    """
    mean = (first.value + second.value) / 2
    apart = mean - mean.mean()
    spread = float(apart @ apart)
    if spread <= _LEAST_SPREAD:
        return Estimate.of(np.nan, np.nan)
    both = (first.covariance - np.diag(second.sigma**2)) / 2
    of_errors = float(np.trace(both) - both.sum() / len(mean))
    weights: Array = apart / spread
    variance = larger * float(weights @ difference.covariance @ weights)
    return Estimate.of(float(weights @ difference.value) - of_errors / spread, np.sqrt(variance))
