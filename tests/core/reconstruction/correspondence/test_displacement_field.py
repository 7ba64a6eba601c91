from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.reconstruction.liners import model, wall
from grabberd.core.reconstruction import Smoothness
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, field_of

SMOOTHNESS = Smoothness(sigma_mm=3.0, reach_mm=30.0, noise_mm=0.15)
MODEL = model()
FIELD = DisplacementField.of(MODEL.xyz_mm, SMOOTHNESS)
COVARIANCE = np.linalg.inv(FIELD.precision)
TRUTH = wall(6.0)[0] - MODEL.xyz_mm


def expect(field, seen):
    """All targets' displacements, from the true ones of those seen."""
    return field.expect(np.flatnonzero(seen), TRUTH[seen])


def regression(known, wanted):
    """Kriging as the textbook has it: mean and variance of `wanted` from the measured `known`."""
    weights = np.linalg.solve(COVARIANCE[np.ix_(known, known)], COVARIANCE[known, wanted])
    variance = COVARIANCE[wanted, wanted] - 0.15**2 - weights @ COVARIANCE[known, wanted]
    return weights @ TRUTH[known], np.sqrt(variance)


@given(st.sets(st.integers(0, 107), min_size=2, max_size=107))
def test_it_expects_of_everybody_what_kriging_from_all_the_others_gives(seen):
    mask = np.zeros(108, bool)
    mask[list(seen)] = True
    expected = expect(FIELD, mask)
    for index in (min(seen), max(seen), next(i for i in range(108) if i not in seen)):
        mean, sigma = regression(np.array(sorted(seen - {index})), index)
        assert np.allclose(expected.displacement_mm[index], mean, atol=1e-6)
        assert np.allclose(expected.sigma_mm[index], sigma, atol=1e-6)


@pytest.mark.parametrize(("sigma_mm", "added_mm"), [(0.05, 0.0), (0.15, 0.0), (0.2, 0.132), (5.0, 0.156)])
def test_nominal_places_known_worse_than_the_noise_widen_what_is_expected(sigma_mm, added_mm):
    """Up to a share of the pitch, here of 6.5 mm; the σ of a single target counts whole."""
    plain, seen = field_of(replace(MODEL, sigma_mm=0.0), SMOOTHNESS, 6.5), np.arange(108) > 0
    wide = field_of(replace(MODEL, sigma_mm=sigma_mm), SMOOTHNESS, 6.5)
    at_least = np.hypot(expect(plain, seen).sigma_mm[0], added_mm)
    assert expect(wide, seen).sigma_mm[0] == pytest.approx(at_least, rel=0.15)
    own = field_of(replace(MODEL, sigma_mm=0.0, own_sigma_mm=np.where(seen, np.nan, 1.0)), SMOOTHNESS, 6.5)
    sigma = expect(own, seen).sigma_mm
    assert sigma[0] == pytest.approx(np.hypot(expect(plain, seen).sigma_mm[0], np.sqrt(1 - 0.15**2)))
    assert np.allclose(sigma[1:], expect(plain, seen).sigma_mm[1:])


def test_when_nobody_is_seen_all_are_expected_at_their_nominal_places_with_the_prior_sigma():
    expected = expect(FIELD, np.zeros(108, bool))
    assert not expected.displacement_mm.any()
    assert np.allclose(expected.sigma_mm, 3.0)


def test_when_all_are_seen_each_is_expected_where_it_is():
    expected = expect(FIELD, np.ones(108, bool))
    assert np.abs(expected.displacement_mm - TRUTH).max() < 0.2


@pytest.mark.parametrize("hidden", [[0], [53, 54], [5, 11, 17, 23, 29, 35]])
def test_a_collapsed_liner_is_met_within_three_sigma(hidden):
    seen = ~np.isin(np.arange(108), hidden)
    expected = expect(FIELD, seen)
    off = np.abs(expected.displacement_mm - TRUTH)[hidden]
    assert (off <= 3 * expected.sigma_mm[hidden, np.newaxis]).all()


def test_the_farther_from_those_who_are_seen_the_less_is_known():
    sigma = expect(FIELD, MODEL.row < 9).sigma_mm.reshape(18, 6)
    assert (np.diff(sigma[8:], axis=0) > 0).all()


def test_what_was_asked_before_changes_no_bit_of_the_answer():
    asked = DisplacementField.of(MODEL.xyz_mm, SMOOTHNESS)
    masks = np.random.default_rng(2).random((70, 108)) < 0.7
    for mask in [*masks, *masks[::-1]]:
        found, fresh = (expect(one, mask) for one in (asked, DisplacementField.of(MODEL.xyz_mm, SMOOTHNESS)))
        np.testing.assert_array_equal(found.displacement_mm, fresh.displacement_mm)
        np.testing.assert_array_equal(found.sigma_mm, fresh.sigma_mm)
