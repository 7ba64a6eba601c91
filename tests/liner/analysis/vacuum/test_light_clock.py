"""The offset between two clocks, from a light that both have seen."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.vacuum.light_clock import LightSignal, relate_clocks

BIT_S = 0.092361
OFFSET_S = 1.234


def pattern(seed, seconds):
    """When the light is on: bits of chance."""
    bits = np.random.default_rng(seed).random(int(seconds / BIT_S) + 400) < 0.5
    return lambda at_s: bits[((at_s + 20) / BIT_S).astype(int)]


def seen(lit, seconds, seed=0, exposure_s=1e-3, share=0.5, scatter_s=0.0):
    """Fields of 50 Hz: a field counts as lit when the light is on for that share of its exposure."""
    rng = np.random.default_rng(seed)
    middle_s = np.arange(0, seconds, 0.02) + rng.uniform(0, 0.02)
    on = np.mean([lit(middle_s + part * exposure_s) for part in np.linspace(-0.5, 0.5, 101)], axis=0)
    return LightSignal(middle_s + rng.normal(0, scatter_s, len(middle_s)), on > share)


def logged(lit, seconds, rate_hz=1000.0, offset_s=OFFSET_S, drift=0.0, seed=0):
    """Readings of a clock that is behind the camera's by the offset in the middle, and drifts."""
    begin_s = -3 + np.random.default_rng(seed).uniform(0, 1 / rate_hz)
    at_s = np.arange(begin_s, seconds + 3, 1 / rate_hz)
    return LightSignal(at_s - offset_s - drift * (at_s - seconds / 2), lit(at_s))


def test_a_minute_gives_the_offset_to_a_tenth_of_a_millisecond() -> None:
    lit = pattern(1, 60)
    found = relate_clocks(seen(lit, 60), logged(lit, 60, drift=4e-5))
    assert found.offset_s == pytest.approx(OFFSET_S, abs=2e-4)
    assert 2e-5 < found.offset_sigma_s < 1.5e-4
    assert found.drift == pytest.approx(4e-5, abs=4 * found.drift_sigma)
    assert found.edges > 200
    at_s = np.array([1.0, 30.0, 59.0])
    assert_allclose(found.camera_s(at_s - OFFSET_S - 4e-5 * (at_s - 30)), at_s, atol=4e-4)


@pytest.mark.parametrize(
    ("seconds", "rate_hz", "scatter_s", "exposure_s", "share"),
    [
        (20, 1000.0, 0.0, 1e-3, 0.3),
        (20, 100.0, 3e-4, 1e-3, 0.5),
        (20, 1000.0, 1e-3, 1e-3, 0.5),
        (20, 200.0, 0.0, 5e-3, 0.2),
    ],
)
def test_the_sigma_is_that_of_the_error(
    seconds: int, rate_hz: float, scatter_s: float, exposure_s: float, share: float
) -> None:
    departures = []
    for seed in range(8):
        lit = pattern(100 + seed, seconds)
        camera = seen(lit, seconds, seed, exposure_s, share, scatter_s)
        drift = np.random.default_rng(seed).normal(0, 5e-5)
        found = relate_clocks(camera, logged(lit, seconds, rate_hz, drift=drift, seed=seed))
        departures.append((found.offset_s - OFFSET_S) / found.offset_sigma_s)
    # Eight cases of a χ² with one degree of freedom each: .13 to 2.8 holds 199 of 200.
    assert 0.13 < np.mean(np.square(departures)) < 2.8


def test_what_delays_going_on_and_hastens_going_off_does_not_move_the_offset() -> None:
    lit = pattern(2, 60)
    late = relate_clocks(seen(lit, 60, exposure_s=4e-3, share=0.9), logged(lit, 60))
    assert late.offset_s == pytest.approx(OFFSET_S, abs=3e-4)
    assert late.asymmetry_s == pytest.approx(0.4 * 4e-3, abs=4e-4)


def test_lost_fields_and_a_hole_in_the_log_leave_fewer_switchings_but_no_error() -> None:
    lit = pattern(3, 60)
    camera, log = seen(lit, 60), logged(lit, 60)
    taken = np.random.default_rng(3).random(len(camera.time_s)) > 0.1
    taken[800:900] = False
    kept = np.abs(log.time_s - 20) > 2
    found = relate_clocks(
        LightSignal(camera.time_s[taken], camera.lit[taken]), LightSignal(log.time_s[kept], log.lit[kept])
    )
    assert found.offset_s == pytest.approx(OFFSET_S, abs=4 * found.offset_sigma_s)
    assert found.offset_sigma_s < 3e-4


def refusal(camera, log):
    with pytest.raises(AnalysisError) as caught:
        relate_clocks(camera, log)
    return str(caught.value)


def test_a_light_that_repeats_its_pattern_is_refused() -> None:
    def lit(at_s):
        return np.mod(at_s, 1.0) < 0.5

    assert "several offsets" in refusal(seen(lit, 20), logged(lit, 20))


def test_another_light_than_the_logger_records_is_refused() -> None:
    assert "at no offset" in refusal(seen(pattern(4, 30), 30), logged(pattern(5, 30), 30))


def test_the_log_of_another_time_is_refused() -> None:
    lit = pattern(6, 200)
    assert "at no offset" in refusal(seen(lit, 20), logged(lambda at_s: lit(at_s + 100), 20))


def test_a_light_that_hardly_switches_is_refused() -> None:
    assert "switches" in refusal(seen(lambda at_s: at_s > 1.0, 2), logged(lambda at_s: at_s > 1.0, 2))


def test_the_relation_is_less_sure_far_from_where_the_light_was_followed() -> None:
    lit = pattern(7, 30)
    found = relate_clocks(seen(lit, 30), logged(lit, 30))
    near_s, far_s = np.linspace(0, 30, 100), np.linspace(600, 630, 100)
    assert found.sigma_s(near_s) < 2 * found.offset_sigma_s
    assert found.sigma_s(far_s) == pytest.approx(600 * found.drift_sigma, rel=0.1)
