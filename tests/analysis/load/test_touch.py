"""The touch as the reference of pressure, and the free wall as the proof of its inputs."""

import numpy as np
import pytest

from grabberd.analysis import Estimate, PressureMap, Shares, first_touch, free_wall, since_touch
from grabberd.errors import AnalysisError


def pressure(value, own=0.5, common=0.0, reason=None):
    value = np.array(value, float)
    n = len(value)
    shares = Shares(np.full(n, own), np.full(n, common), np.zeros(n), np.zeros(n), np.zeros((3, n)))
    contact = Estimate(value, shares.sigma_kpa)
    return PressureMap(np.arange(n), np.zeros(n), contact, contact, value, shares, reason or ("",) * n)


def test_the_first_touch_is_the_first_pressure_that_lasts():
    series = [pressure(v) for v in ([0, 0.1, 0], [9, 0, 0], [0, 0, 5], [0, 4, 6])]
    assert first_touch(series) == (2, 2)


def test_a_place_that_says_nothing_touches_nothing():
    silent = [pressure([9.0, 0.0], reason=("no targets near enough", "")) for _ in range(3)]
    with pytest.raises(AnalysisError, match="in none of 3 fields"):
        first_touch(silent)


def test_no_fields_have_no_touch():
    with pytest.raises(AnalysisError, match="in none of 0 fields"):
        first_touch([])


def test_against_the_touch_what_both_fields_have_in_common_falls_out():
    result = since_touch(pressure([8.0, 6.0], common=2.0), pressure([3.0, 2.0], common=2.0))
    assert result.value == pytest.approx([5.0, 4.0])
    assert result.sigma == pytest.approx([0.5 * 2**0.5] * 2)


def test_a_free_wall_without_pressure_agrees():
    noise = np.random.default_rng(0).normal(size=200) * 0.5
    result = free_wall(pressure(noise), np.ones(200, bool))
    assert result.agrees
    assert result.misfit == pytest.approx(1.0, abs=0.3)
    assert abs(result.residual_kpa.value) < 0.2


def test_a_free_wall_with_pressure_says_how_much_and_where():
    values = np.full(20, 2.0)
    values[7] = 4.0
    result = free_wall(pressure(values), np.arange(20) < 10)
    assert not result.agrees
    assert result.residual_kpa.value == pytest.approx(2.2)
    assert result.worst == (7, pytest.approx(8.0))


def test_places_that_are_not_free_have_no_part_in_it():
    values = np.zeros(20)
    values[15] = 50.0
    assert free_wall(pressure(values), np.arange(20) < 10).agrees


def test_without_a_free_place_there_is_no_check():
    with pytest.raises(AnalysisError, match="none of the 0 places"):
        free_wall(pressure([0.0, 1.0]), np.zeros(2, bool))
