"""The recursions against one dense Gaussian over all states, which is what they must be equal to."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd.core.reconstruction.kalman_chains import Chains, likelihood, smoothed_chains

FIELDS, COUNT = 14, 5


def chains(acceleration=300.0, seed=0, missing=0.2):
    rng = np.random.default_rng(seed)
    elapsed = np.full(FIELDS, 0.02)
    elapsed[0], elapsed[6] = 0.0, 0.06
    value = rng.normal(0, 1, (FIELDS, COUNT))
    value[rng.random((FIELDS, COUNT)) < missing] = np.nan
    value[0] = rng.normal(0, 1, COUNT)
    sign = np.where(np.arange(FIELDS) % 2, -1.0, 1.0)[:, np.newaxis]
    return Chains(
        value_mm=value,
        white_mm2=rng.uniform(0.5, 1.5, (FIELDS, COUNT)),
        common_mm=rng.uniform(0.2, 0.6, (FIELDS, COUNT)),
        opposite_mm=sign * rng.uniform(0.2, 0.6, (FIELDS, COUNT)),
        keeps=rng.uniform(0.0, 1.0, (FIELDS, COUNT)),
        elapsed_s=elapsed,
        acceleration_mm_s2=np.full((FIELDS, 1), acceleration),
    )


def dense(known, chain):
    """Mean, variance and rate of the places, and the log likelihood, from all states at once."""
    size = 4 * FIELDS
    factor, noise = np.zeros((size, size)), np.zeros((size, size))
    start = np.diag([1e4, 500.0**2 if known.acceleration_mm_s2.any() else 0.0, 1.0, 1.0])
    for k in range(FIELDS):
        own, t = slice(4 * k, 4 * k + 4), known.elapsed_s[k]
        keeps = known.keeps[k, chain]
        step = np.diag([1.0, 1.0, keeps, keeps])
        step[0, 1] = t
        disturbed = known.acceleration_mm_s2[k, 0] ** 2 * 0.02
        added = np.zeros((4, 4))
        added[:2, :2] = disturbed * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
        added[2, 2] = added[3, 3] = 1 - keeps**2
        if k == 0:
            added += step @ start @ step.T
        else:
            factor[own, 4 * k - 4 : 4 * k] = step
        noise[own, own] = added
    spread = np.linalg.inv(np.eye(size) - factor)
    prior = spread @ noise @ spread.T
    seen = np.isfinite(known.value_mm[:, chain])
    design = np.zeros((FIELDS, size))
    for k in range(FIELDS):
        row = [1.0, 0.0, known.common_mm[k, chain], known.opposite_mm[k, chain]]
        design[k, 4 * k : 4 * k + 4] = row
    design = design[seen]
    first = known.value_mm[np.flatnonzero(seen)[0], chain]
    surprise = known.value_mm[seen, chain] - first
    variance = design @ prior @ design.T + np.diag(known.white_mm2[seen, chain])
    gain = prior @ design.T @ np.linalg.inv(variance)
    mean, covariance = gain @ surprise, prior - gain @ design @ prior
    squares = surprise @ np.linalg.solve(variance, surprise)
    _, logarithm = np.linalg.slogdet(variance)
    places = np.arange(0, size, 4)
    return first + mean[places], np.diag(covariance)[places], mean[places + 1], -0.5 * (squares + logarithm)


@pytest.mark.parametrize("acceleration", [0.0, 300.0, 5000.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_smoothing_is_what_all_measurements_together_say(acceleration, seed):
    known = chains(acceleration, seed)
    result = smoothed_chains(known)
    for chain in range(COUNT):
        value, variance, rate, _ = dense(known, chain)
        assert np.allclose(result.value_mm[:, chain], value, atol=1e-6)
        assert np.allclose(result.variance_mm2[:, chain], variance, rtol=1e-4)
        assert np.allclose(result.rate_mm_s[:, chain], rate, atol=1e-4)


@pytest.mark.parametrize("acceleration", [0.0, 300.0])
def test_the_likelihood_is_that_of_all_measurements_together(acceleration):
    known = chains(acceleration, 2)
    assert likelihood(known) == pytest.approx([dense(known, chain)[3] for chain in range(COUNT)], abs=1e-5)


def test_many_chains_are_smoothed_in_parts():
    known = chains()
    for one, other in zip(smoothed_chains(known), smoothed_chains(known, 2 * FIELDS), strict=True):
        assert np.allclose(one, other, rtol=1e-9)


def test_at_rest_with_white_noise_the_place_is_the_weighted_mean():
    known = chains(0.0, 3, missing=0.0)
    nothing = np.zeros((FIELDS, COUNT))
    result = smoothed_chains(replace(known, common_mm=nothing, opposite_mm=nothing))
    weight = 1 / known.white_mm2
    mean = (weight * known.value_mm).sum(axis=0) / weight.sum(axis=0)
    assert np.allclose(result.value_mm, mean, atol=1e-3)
    assert np.allclose(result.variance_mm2, 1 / weight.sum(axis=0), rtol=1e-4)
    assert not result.rate_mm_s.any()
