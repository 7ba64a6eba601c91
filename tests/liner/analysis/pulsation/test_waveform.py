"""Periodic quantities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_liner.analysis.pulsation.movement import Waveform, basis, basis_slope, prior_precision, rotated

phases = st.floats(-3, 3)


def waveform(seed=0, count=4):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2 * count + 1, 2 * count + 1))
    return Waveform(rng.normal(size=2 * count + 1), root @ root.T)


@given(phases)
def test_it_repeats_itself_with_the_cycle(phase: float) -> None:
    values = waveform().value(np.array([phase, phase + 1]))
    assert values[0] == pytest.approx(values[1], abs=1e-9)


@given(phases)
def test_its_slope_is_the_derivative_of_its_value(phase: float) -> None:
    step = 1e-5
    before, after = waveform().value(np.array([phase - step, phase + step]))
    assert waveform().slope(np.array(phase)) == pytest.approx((after - before) / 2 / step, abs=1e-4)


@given(phases, phases)
def test_turned_it_is_the_same_with_another_beginning(phase: float, by: float) -> None:
    turned = waveform().turned(by)
    assert turned.value(np.array(phase)) == pytest.approx(waveform().value(np.array(phase + by)), abs=1e-9)
    assert turned.sigma(np.array(phase)) == pytest.approx(waveform().sigma(np.array(phase + by)), abs=1e-9)


def test_turning_once_round_changes_nothing() -> None:
    coefficients = waveform().coefficients
    assert_allclose(rotated(coefficients, 1.0), coefficients, atol=1e-12)


def test_crossings_of_a_sine_are_where_they_are() -> None:
    sine = Waveform(np.array([2.0, 0.0, 1.0]), np.zeros((3, 3)))
    rising, falling = sine.crossings(2.5)
    assert_allclose(rising, [1 / 12], atol=1e-6)
    assert_allclose(falling, [5 / 12], atol=1e-6)
    assert sine.extremes() == (0.75, 0.25)


def test_the_level_of_a_plateau_is_its_middle() -> None:
    low, high = waveform().levels()
    values = waveform().value(np.linspace(0, 1, 5000))
    assert values.min() < low < values.min() + 0.01 * np.ptp(values)
    assert values.max() > high > values.max() - 0.01 * np.ptp(values)


def test_the_prior_has_the_variance_it_is_asked_for() -> None:
    variances = 1 / prior_precision(12, 3.0)
    assert variances[1:].sum() / 2 == pytest.approx(3.0)
    assert variances[1] / variances[4] == pytest.approx(256)


def test_basis_and_slope_have_a_row_a_phase() -> None:
    assert basis(np.zeros((2, 3)), 5).shape == basis_slope(np.zeros((2, 3)), 5).shape == (2, 3, 11)
