"""How late a logger's clock is, from the wall's movement."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.fake.iso_phases import iso_phases_s
from grabberd.errors import AnalysisError, InputError
from grabberd_fake.vacuum import vacuum_log
from grabberd_liner.analysis.pulsation.movement import first_movement
from grabberd_liner.analysis.pulsation.pulsation import fit_pulsation
from grabberd_liner.analysis.vacuum.vacuum import PulsatorWave, WallLag, find_offset
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log
from liner.analysis.pulsating import CLOSED_HALF_S, LINER, OPEN_HALF_S, capture, times

LAG = WallLag(OPEN_HALF_S - (-0.04 + 0.06), CLOSED_HALF_S - (0.6 - 0.03 + 0.05), 0.001)


@pytest.fixture(scope="module")
def pulsation():
    return fit_pulsation(first_movement([capture(times(200))]))


def log(offset_s, noise_kpa=0.2, start_ns=-1_000_000_000, seconds=6, seed=0):
    """A logger that began a second before the camera's zero: its own clock is told in seconds since that."""
    end_ns = start_ns + round(seconds * 1e9)
    lines = vacuum_log(LINER, start_ns, end_ns, offset_s - start_ns / 1e9, noise_kpa, seed=seed)
    return read_vacuum_log("\n".join(lines))


@settings(max_examples=15, deadline=None)
@given(st.floats(-20, 20), st.integers(0, 50))
def test_the_offset_is_found_to_a_millisecond(pulsation, offset_s: float, seed: int) -> None:
    found = find_offset(log(offset_s, seed=seed), pulsation, LAG, near_s=offset_s + 0.3)
    assert found.offset_s == pytest.approx(offset_s, abs=1e-3)
    assert 0.0009 < found.sigma_s < 0.003
    assert found.events >= 8


def test_without_the_walls_lag_only_the_sum_is_known(pulsation) -> None:
    found = find_offset(log(0.37), pulsation, None, near_s=0.37)
    assert found.opening_shift_s == pytest.approx(0.37 + LAG.opening_s, abs=1e-3)
    assert found.closing_shift_s == pytest.approx(0.37 + LAG.closing_s, abs=1e-3)
    with pytest.raises(InputError, match="the data cannot separate") as caught:
        _ = found.offset_s
    assert "lag of opening and closing" in caught.value.hint


def test_a_wrong_lag_moves_the_offset_by_as_much_and_nothing_tells(pulsation) -> None:
    wrong = WallLag(LAG.opening_s + 0.01, LAG.closing_s + 0.01, 0.001)
    right, moved = (find_offset(log(0.37), pulsation, lag, near_s=0.37) for lag in (LAG, wrong))
    assert moved.offset_s == pytest.approx(right.offset_s - 0.01, abs=1e-9)
    assert moved.sigma_s == pytest.approx(right.sigma_s)


def test_lags_that_contradict_each_other_are_seen_in_sigma(pulsation) -> None:
    wrong = WallLag(LAG.opening_s + 0.01, LAG.closing_s - 0.01, 0.001)
    assert find_offset(log(0.37), pulsation, wrong, near_s=0.37).sigma_s == pytest.approx(0.01, abs=2e-3)


def test_whole_cycles_are_chosen_by_what_is_known_of_the_clocks(pulsation) -> None:
    for near_s in (0.1, 0.8, -0.1, 1.2):
        found = find_offset(log(0.37), pulsation, LAG, near_s=near_s)
        assert abs(found.offset_s - near_s) <= 0.5 + 1e-3
        assert (found.offset_s - 0.37) % 1.0 == pytest.approx(round((found.offset_s - 0.37) % 1.0), abs=1e-3)


def test_a_pulsators_settings_are_set_to_the_walls_time_alike(pulsation) -> None:
    a_s, b_s, c_s, _ = iso_phases_s(LINER)
    wave = PulsatorWave(60.0, a_s + b_s, a_s, c_s, 42.0, 0.5)
    found = find_offset(wave.log(-1.0, 6.0), pulsation, LAG, near_s=0.0)
    begins_s = -0.04 + 0.12 * 4 / 42
    assert found.offset_s == pytest.approx(begins_s, abs=1e-3)


def test_a_log_of_another_time_is_refused(pulsation) -> None:
    with pytest.raises(InputError, match="does not cover the capture"):
        find_offset(log(0.37), pulsation, LAG, near_s=100.37)


def test_a_log_of_another_pulsator_is_refused(pulsation) -> None:
    wave = PulsatorWave(55.0, 0.6, 0.12, 0.1, 42.0, 0.5)
    with pytest.raises(AnalysisError, match=r"vacuum's cycle is 1.091 s, the wall's 1.000 s"):
        find_offset(wave.log(0.0, 6.0), pulsation, LAG, near_s=0.0)


def test_more_noise_more_sigma(pulsation) -> None:
    noisy = fit_pulsation(first_movement([capture(times(100), 0.15)]))
    sigmas = [
        find_offset(log(0.37), one, WallLag(*LAG[:2], 0.0), near_s=0.37).sigma_s for one in (pulsation, noisy)
    ]
    assert sigmas[0] < 5e-4 < 5 * sigmas[0] + sigmas[1]
    assert np.isfinite(sigmas).all()
    assert sigmas[1] > sigmas[0]
