"""What tests drop is not known to be zero, and small residuals make no certificate better."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import network
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.significance import eliminate, with_stated_covariance


@pytest.fixture(scope="module")
def given():
    return network(sigma_px=0.02, target_sigma_mm=0.01, seed=3)


@pytest.fixture(scope="module")
def unknowns(given):
    return Unknowns.of(given.views)


def test_dropped_terms_have_a_sigma_and_stay_zero(given, unknowns):
    kept = eliminate(given, unknowns)
    assert kept.dropped
    stated = with_stated_covariance(kept.adjustment, unknowns)
    assert stated.views == kept.adjustment.views
    assert len(stated.unknowns) == len(unknowns)
    sigma = dict(zip(stated.unknowns.names, stated.sigma, strict=True))
    assert all(sigma[name] > 0 for name in kept.dropped)
    before = dict(zip(kept.adjustment.unknowns.names, kept.adjustment.sigma, strict=True))
    assert all(sigma[name] > 0.9 * before[name] for name in before)


@pytest.mark.parametrize("doubt", [0.0, 0.25, 1.0])
def test_dropped_terms_count_as_far_as_they_are_doubted(given, unknowns, doubt):
    kept = eliminate(given, unknowns)
    with_all = with_stated_covariance(kept.adjustment, unknowns)
    without = dict(zip(kept.adjustment.unknowns.names, kept.adjustment.sigma**2, strict=True))
    trusted = min(kept.adjustment.sigma0, 1.0) ** 2
    variance = np.array([without.get(name, 0.0) / trusted for name in unknowns.names])
    stated = with_stated_covariance(kept.adjustment, unknowns, doubt)
    np.testing.assert_allclose(stated.sigma**2, (1 - doubt) * variance + doubt * with_all.sigma**2)


def test_image_points_better_than_their_sigma_leave_the_certificate_as_it_is(given, unknowns):
    careless = replace(given, sigma_px=5 * given.sigma_px)
    adjusted = adjust(careless, unknowns)
    assert adjusted.sigma0 < 0.8
    stated = with_stated_covariance(adjusted, unknowns)
    np.testing.assert_allclose(stated.sigma, adjusted.sigma / adjusted.sigma0, rtol=1e-3)
    assert stated.sigma0 == 1.0


def test_residuals_larger_than_sigma_count(given, unknowns):
    bold = replace(given, sigma_px=given.sigma_px / 5, target_sigma_mm=given.target_sigma_mm / 5)
    adjusted = adjust(bold, unknowns)
    assert adjusted.sigma0 > 2
    np.testing.assert_allclose(with_stated_covariance(adjusted, unknowns).sigma, adjusted.sigma, rtol=1e-3)
