"""Kalman filter and smoother for many scalar chains in parallel, and the acceleration each interval shows.

The state of a chain is (x, v, c, d): a position, its rate, and two errors of unit variance. A measurement is
z = x + h_c·c ± h_d·d + white noise, with + for one parity and − for the other. Chains run along the last axis
of all arrays. They are smoothed after Bryson and Frazier, which needs no inverse covariance and therefore
works without any motion noise; accelerations maximise the marginal likelihood, by MacKay's fixed point.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array

_STATES = 4
_MOST_SURPRISE = 25.0
"""Greatest squared innovation in the likelihood: 5 σ."""
AT_ONCE = 1_000_000
"""Measurements smoothed at once; each takes two hundred bytes."""
_START_MM2 = 1e4
_START_RATE_MM2_S2 = 500.0**2
_ACCELERATES_EVERY_S = 0.02
"""Time for which an acceleration lasts: a property of what moves, whatever the rate of the fields."""


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """B chains of F measurements.

    Attributes:
        value_mm: (F, B), NaN where nothing was measured.
        white_mm2: (F, B) variance of the white noise.
        common_mm: (F, B) h_c, standard deviation of the locked error common to both parities.
        opposite_mm: (F, B) ±h_d, standard deviation of the locked error in which they differ, with the
            parity's sign.
        keeps: (F, B) correlation of the locked errors with those of the previous measurement, 0 to 1.
        elapsed_s: (F,) time since the previous measurement; 0 for the first.
        acceleration_mm_s2: (F, B) or (F, 1) standard deviation of the acceleration since the previous
            measurement, drawn anew every 20 ms; 0 everywhere means rest.
    """

    value_mm: Array
    white_mm2: Array
    common_mm: Array
    opposite_mm: Array
    keeps: Array
    elapsed_s: Array
    acceleration_mm_s2: Array

    def part(self, chosen: slice) -> "Chains":
        """Select some of the chains."""
        return replace(
            self,
            value_mm=self.value_mm[:, chosen],
            white_mm2=self.white_mm2[:, chosen],
            common_mm=self.common_mm[:, chosen],
            opposite_mm=self.opposite_mm[:, chosen],
            keeps=self.keeps[:, chosen],
            acceleration_mm_s2=np.broadcast_to(self.acceleration_mm_s2, self.value_mm.shape)[:, chosen],
        )


class SmoothedChains(NamedTuple):
    """(F, B) positions, their variances, and rates; and what the measurements say about the acceleration.

    Attributes:
        value_mm: Positions.
        variance_mm2: Their variances.
        rate_mm_s: Rates.
        accelerated: Square of the acceleration that the measurements show since the previous one, in units of
            its assumed variance.
        freedom: Degrees of freedom with which they show it, 0 to 2: its expectation if that is right.
    """

    value_mm: Array
    variance_mm2: Array
    rate_mm_s: Array
    accelerated: Array
    freedom: Array


class _Step(NamedTuple):
    """Result of a filter step: state (4, B) and covariance (4, 4, B), gain, innovation, its inverse
    variance.
    """

    state: Array
    covariance: Array
    gain: Array
    surprise: Array
    weight: Array


def likelihood(chains: Chains) -> Array:
    """(B,) log likelihood of each chain's measurements, up to a constant.

    Each counts for at most five standard deviations, so that no outlier decides.
    """
    total = np.zeros(chains.value_mm.shape[1])
    state, covariance = _start(chains)
    for k in range(len(chains.value_mm)):
        step = _step(chains, k, state, covariance)
        logarithm = np.log(np.where(step.weight > 0, step.weight, 1.0))
        total += 0.5 * (logarithm - np.minimum(step.surprise**2 * step.weight, _MOST_SURPRISE))
        state, covariance = step.state, step.covariance
    return total


def smoothed_chains(chains: Chains, at_once: int = AT_ONCE) -> SmoothedChains:
    """Smooth positions and rates using all measurements, earlier and later ones.

    Results before a chain's first measurement are meaningless.

    Args:
        chains: B chains of F measurements.
        at_once: Greatest number of measurements processed at a time, to limit memory.
    """
    fields, count = chains.value_mm.shape
    width = max(at_once // max(fields, 1), 1)
    parts = [_smoothed(chains.part(slice(first, first + width))) for first in range(0, count, width)]
    return SmoothedChains(*(np.concatenate(each, axis=1) for each in zip(*parts, strict=True)))


def _smoothed(chains: Chains) -> SmoothedChains:
    steps: list[_Step] = []
    state, covariance = _start(chains)
    for k in range(len(chains.value_mm)):
        steps.append(_step(chains, k, state, covariance))
        state, covariance = steps[-1].state, steps[-1].covariance
    return _backward(chains, steps)


def _start(chains: Chains) -> tuple[Array, Array]:
    """Start near each chain's first measurement, to 100 mm so that it can be used again."""
    count = chains.value_mm.shape[1]
    first = np.isfinite(chains.value_mm).argmax(axis=0)
    state = np.zeros((_STATES, count))
    state[0] = np.nan_to_num(chains.value_mm[first, np.arange(count)])
    covariance = np.zeros((_STATES, _STATES, count))
    covariance[0, 0] = _START_MM2
    covariance[1, 1] = _START_RATE_MM2_S2 * chains.acceleration_mm_s2.any()
    covariance[2, 2] = covariance[3, 3] = 1.0
    return state, covariance


def _step(chains: Chains, k: int, state: Array, covariance: Array) -> _Step:
    """Predict measurement k and update with it."""
    state, covariance = _predicted(chains, k, state, covariance)
    common, opposite = chains.common_mm[k], chains.opposite_mm[k]
    seen = covariance[:, 0] + common * covariance[:, 2] + opposite * covariance[:, 3]
    variance = seen[0] + common * seen[2] + opposite * seen[3] + chains.white_mm2[k]
    surprise = chains.value_mm[k] - state[0] - common * state[2] - opposite * state[3]
    measured = np.isfinite(surprise)
    weight = np.where(measured, 1.0 / variance, 0.0)
    surprise = np.where(measured, surprise, 0.0)
    gain = seen * weight
    return _Step(state + gain * surprise, covariance - gain[:, np.newaxis] * seen, gain, surprise, weight)


def _predicted(chains: Chains, k: int, state: Array, covariance: Array) -> tuple[Array, Array]:
    elapsed, keeps = chains.elapsed_s[k], chains.keeps[k]
    state, covariance = state.copy(), covariance.copy()
    state[0] += elapsed * state[1]
    state[2:] *= keeps
    covariance[0] += elapsed * covariance[1]
    covariance[:, 0] += elapsed * covariance[:, 1]
    covariance[2:] *= keeps
    covariance[:, 2:] *= keeps
    covariance[2, 2] += 1.0 - keeps * keeps
    covariance[3, 3] += 1.0 - keeps * keeps
    covariance[:2, :2] += _noise(chains, k)
    return state, covariance


def _noise(chains: Chains, k: int) -> Array:
    """(2, 2, B) covariance of white acceleration, integrated over the time before measurement k to position
    and rate.
    """
    elapsed = chains.elapsed_s[k]
    each = elapsed * np.array([[elapsed**2 / 3.0, elapsed / 2.0], [elapsed / 2.0, 1.0]])
    return each[..., np.newaxis] * chains.acceleration_mm_s2[k] ** 2 * _ACCELERATES_EVERY_S


def _backward(chains: Chains, steps: list[_Step]) -> SmoothedChains:
    """Run the modified Bryson–Frazier recursion, which carries later measurements back as gradient and
    information.
    """
    shape = chains.value_mm.shape
    value, variance, rate, accelerated, freedom = (np.empty(shape) for _ in range(5))
    gradient = np.zeros((_STATES, shape[1]))
    information = np.zeros((_STATES, _STATES, shape[1]))
    for k in range(shape[0] - 1, -1, -1):
        step = steps[k]
        state = step.state - np.einsum("ijb,jb->ib", step.covariance, gradient)
        first = step.covariance[0]
        value[k], rate[k] = state[0], state[1]
        variance[k] = first[0] - np.einsum("ib,ijb,jb->b", first, information, first)
        gradient, information = _over_measurement(chains, k, step, gradient, information)
        noise = _noise(chains, k)
        pull = gradient[:2]
        accelerated[k] = np.einsum("ib,ijb,jb->b", pull, noise, pull)
        freedom[k] = np.einsum("ijb,jib->b", noise, information[:2, :2])
        gradient, information = _over_time(chains, k, gradient, information)
    return SmoothedChains(value, variance, rate, accelerated, freedom)


def _over_measurement(
    chains: Chains, k: int, step: _Step, gradient: Array, information: Array
) -> tuple[Array, Array]:
    """Carry gradient and information back over measurement k."""
    carried = np.einsum("ijb,jb->ib", information, step.gain)
    pull = (step.gain * gradient).sum(axis=0) + step.surprise * step.weight
    certainty = (step.gain * carried).sum(axis=0) + step.weight
    ones = np.ones_like(pull)
    seen = np.stack([ones, 0.0 * ones, chains.common_mm[k], chains.opposite_mm[k]])
    mixed = seen[:, np.newaxis] * carried
    gradient = gradient - seen * pull
    information = information - mixed - mixed.swapaxes(0, 1) + certainty * seen[:, np.newaxis] * seen
    return gradient, information


def _over_time(chains: Chains, k: int, gradient: Array, information: Array) -> tuple[Array, Array]:
    """Carry gradient and information back over the time before measurement k; changes the arrays."""
    elapsed, keeps = chains.elapsed_s[k], chains.keeps[k]
    gradient[1] += elapsed * gradient[0]
    gradient[2:] *= keeps
    information[1] += elapsed * information[0]
    information[:, 1] += elapsed * information[:, 0]
    information[2:] *= keeps
    information[:, 2:] *= keeps
    return gradient, information


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
