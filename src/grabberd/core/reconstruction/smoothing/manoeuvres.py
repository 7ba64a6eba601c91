"""Manoeuvres: the acceleration of every target between two fields, as its points show it.

A liner rests for most of a pulsation and closes within one to eight fields. No single acceleration suits
both: one suited to rest lags behind a closure, and contradicts points that are right; one suited to a closure
averages nothing. Here every interval between two fields has an acceleration of its own, common to all targets
because they move together, times a factor for each chain because they do not move equally far.

Both are found as the maximum of the marginal likelihood, by MacKay's fixed point: the smoother tells how much
acceleration an interval shows, in units of its assumed variance, and with how many degrees of freedom; at the
maximum the two are equal. A prior of some degrees of freedom pulls what the points do not determine to the
acceleration at rest.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.smoothing.kalman_chains import Chains, smoothed_chains

Array = NDArray[np.float64]

FASTEST_MM_S2 = 40_000.0
"""Acceleration to start from: it follows a closure of 10 mm in a single field."""
_SLOWEST_MM_S2 = 5.0
"""Acceleration that the prior takes for likely."""
_ROUNDS = 14
_PRIOR = 1.0
"""Degrees of freedom of the prior of an interval's acceleration, and of a chain's factor."""
_MOST = 9.0
"""Greatest count of one measurement, in units of its degrees of freedom: no wrong point decides for all."""


def manoeuvres(chains: Chains) -> Array:
    """(F, B) standard deviation of the acceleration before each measurement.

    Args:
        chains: B chains of F measurements; their acceleration is not used.
    """
    fields, count = chains.value_mm.shape
    of_field = np.full((fields, 1), FASTEST_MM_S2**2)
    of_chain = np.ones(count)
    for number in range(_ROUNDS):
        smoothed = smoothed_chains(replace(chains, acceleration_mm_s2=np.sqrt(of_field * of_chain)))
        shown = np.minimum(smoothed.accelerated, _MOST * smoothed.freedom)
        if number % 3 == 2:
            of_chain = _updated(of_chain, shown, smoothed.freedom, 1.0, 0)
        else:
            of_field = _updated(of_field, shown, smoothed.freedom, _SLOWEST_MM_S2**2, 1)
    return np.sqrt(of_field * of_chain)


def _updated(variance: Array, shown: Array, freedom: Array, prior: float, axis: int) -> Array:
    shown, freedom = (each.sum(axis=axis).reshape(variance.shape) for each in (shown, freedom))
    ratio = (shown + _PRIOR * prior / variance) / (freedom + _PRIOR)
    # Rest shows hardly any acceleration, so the fixed point is approached slowly from above: in double steps.
    return variance * np.where(ratio < 1.0, ratio * ratio, ratio)
