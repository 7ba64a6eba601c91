"""The surface, where data support it and how noise goes through it."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.surface.jets import index
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms
from liner.analysis.collapsing import SIGMA_8_BIT_MM, as_points, grid, points

SMOOTHING = Smoothing(45.0, 10.0, (0.1, 2.0, 1.5))
PLACES = np.array([30.0, 58.5, 90.0]), np.array([10.0, 17.7, 30.0])


def field(seed=0, closed=0.5):
    return points(closed, SIGMA_8_BIT_MM, np.random.default_rng(seed))


def without(*targets):
    seen = field()
    return fit_surface(grid(), seen.select(~np.isin(seen.target, targets)), SMOOTHING)


def at(surface, target, du=0.0, dv=0.0):
    """Whether data support the place so many pitches from a target's."""
    place = target - 1
    u_mm = grid().u_mm[[place]] + du * grid().u_pitch_mm
    return bool(surface.within(u_mm, grid().v_mm[[place]] + dv * grid().v_pitch_mm)[0])


def test_data_support_half_a_pitch_beyond_the_outermost_targets_and_no_more():
    surface = without()
    assert at(surface, 1, du=-0.5, dv=-0.5)
    assert not at(surface, 1, du=-0.51)
    assert not at(surface, 108, dv=0.6)


def test_one_missing_target_is_bridged_and_two_beside_each_other_are_a_hole():
    assert at(without(45), 45)
    assert not at(without(45, 46), 45)
    assert not at(without(45, 46), 46)
    assert at(without(45, 46), 44)
    assert at(without(45, 46), 45, dv=-0.6)


def test_missing_targets_that_touch_at_a_corner_alone_are_bridged():
    surface = without(45, 52)
    assert at(surface, 45)
    assert at(surface, 52)


def kappa(jets):
    return curvature_per_m(outer_forms(jets, grid().outward))


def test_sigma_is_by_how_much_surfaces_drawn_from_the_posterior_spread():
    surface = fit_surface(grid(), field(), SMOOTHING)
    draws = np.random.default_rng(5).normal(size=(2000, surface.factor.shape[2]))
    coefficients = surface.coefficients + np.einsum("ark,dk->dar", surface.factor, draws)
    modes = surface.modes.jets(*PLACES)
    jets = surface.base(*PLACES) + np.einsum("npr,dar->dnpa", modes, coefficients, optimize=True)
    sigma = surface.propagate(kappa, *PLACES, highest=2).sigma
    np.testing.assert_allclose(kappa(jets).std(axis=0), sigma, rtol=0.1)


def test_sigma_is_by_how_much_fields_of_surfaces_drawn_from_the_prior_err():
    """Truth and noise drawn anew for every field: errors over σ have variance one (Monte Carlo)."""
    rng, ratios = np.random.default_rng(6), []
    first = fit_surface(grid(), field(), SMOOTHING)
    amplitude = 0.1 * np.array(SMOOTHING.amplitude_mm)
    modest = SMOOTHING._replace(amplitude_mm=tuple(amplitude))
    for _ in range(60):
        drawn = amplitude[:, np.newaxis] * rng.normal(size=(3, first.modes.size))
        drawn[:, :4] = 0.0
        truth = replace(first, coefficients=drawn)
        exact = truth.jets(grid().u_mm, grid().v_mm)[:, 0]
        noisy = exact + rng.normal(size=exact.shape) * SIGMA_8_BIT_MM
        estimate = fit_surface(grid(), as_points(grid().target, noisy, SIGMA_8_BIT_MM), modest).propagate(
            kappa, *PLACES, highest=2
        )
        ratios.append((estimate.value - kappa(truth.jets(*PLACES))) / estimate.sigma)
    assert (np.array(ratios) ** 2).mean() == pytest.approx(1.0, abs=0.2)


def test_the_slow_way_and_the_ways_for_given_slopes_and_for_sums_agree():
    surface = fit_surface(grid(), field(), SMOOTHING)
    slopes = np.random.default_rng(1).normal(size=(3, 6, 3))
    slow = surface.propagate(lambda jets: (jets[..., :6, :] * slopes).sum(axis=(-2, -1)), *PLACES).sigma
    apart = np.zeros((3, 3, 6, 3))
    apart[np.arange(3), np.arange(3)] = slopes
    np.testing.assert_allclose(surface.sigma(slopes, *PLACES), slow, rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(surface.covariance(apart, *PLACES))), slow, rtol=1e-9)


def test_a_reference_brings_its_own_sigma():
    surface, reference = (
        fit_surface(grid(), field(1), SMOOTHING),
        fit_surface(grid(), field(2, 0.0), SMOOTHING),
    )
    height = index(0, 0)
    moved = surface.propagate(
        lambda jets, other: (jets - other)[..., height, :], *PLACES, reference=reference, highest=0
    )
    alone = [one.propagate(lambda jets: jets[..., height, :], *PLACES).sigma for one in (surface, reference)]
    np.testing.assert_allclose(moved.sigma, np.hypot(*alone), rtol=1e-9)
    np.testing.assert_allclose(
        moved.value, surface.jets(*PLACES)[:, 0] - reference.jets(*PLACES)[:, 0], rtol=1e-12
    )
