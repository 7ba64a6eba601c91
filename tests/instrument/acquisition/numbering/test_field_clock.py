"""The clock filter takes the jitter out of timestamps and follows the camera's own clock."""

import numpy as np
import pytest

from grabberd.instrument.acquisition.numbering.timing import FieldClock

PERIOD_NS = 20_000_000


def run(clock, times_ns):
    clock.lock(int(times_ns[0]))
    return np.array([clock.advance(1, int(time_ns)) for time_ns in times_ns[1:]])


def test_it_is_not_locked_before_its_first_field():
    clock = FieldClock(PERIOD_NS)
    assert not clock.locked
    clock.lock(5)
    assert clock.locked


def test_steps_are_counted_from_the_field_that_it_has_come_to():
    clock = FieldClock(PERIOD_NS)
    clock.lock(1_000)
    clock.advance(2)
    assert clock.steps_to(1_000 + 5 * PERIOD_NS) == pytest.approx(3.0)


def test_without_a_measured_time_it_goes_on_by_the_period():
    clock = FieldClock(PERIOD_NS)
    clock.lock(123)
    assert clock.advance(50) == 123 + 50 * PERIOD_NS


def test_even_times_pass_unchanged():
    times = 987_654_321_987_654_321 + PERIOD_NS * np.arange(5_000)
    assert np.array_equal(run(FieldClock(PERIOD_NS), times), times[1:])


def test_the_times_of_a_recording_pass_as_they_are():
    times = np.cumsum(np.random.default_rng(1).integers(1, 60_000_000, 500))
    assert np.array_equal(run(FieldClock(PERIOD_NS, exact=True), times), times[1:])


def test_the_first_corrections_are_those_of_a_running_mean():
    clock = FieldClock(PERIOD_NS)
    clock.lock(0)
    assert clock.advance(1, PERIOD_NS + 6_000_000) == pytest.approx(PERIOD_NS + 3_000_000, abs=4_000)
    assert clock.advance(1, 2 * PERIOD_NS + 3_000_000) == pytest.approx(2 * PERIOD_NS + 3_000_000, abs=4_000)
    assert clock.advance(1, 3 * PERIOD_NS) == pytest.approx(3 * PERIOD_NS + 2_250_000, abs=4_000)


def test_times_that_are_late_from_now_on_are_followed_within_two_seconds_and_critically_damped():
    clock = FieldClock(PERIOD_NS)
    run(clock, PERIOD_NS * np.arange(1_000))
    n = np.arange(1_000, 2_000)
    late = np.array([clock.advance(1, int(PERIOD_NS * one + 1_000_000)) for one in n]) - PERIOD_NS * n
    assert late[100] == pytest.approx(1_000_000, rel=0.01)
    assert late.max() < 1_140_000
    assert late[-1] == pytest.approx(1_000_000, rel=0.001)


def test_batches_of_eight_milliseconds_are_smoothed_to_less_than_one():
    true = PERIOD_NS * np.arange(3_000)
    late = np.random.default_rng(2).integers(0, 8_000_000, 3_000)
    errors = run(FieldClock(PERIOD_NS), true + late) - true[1:] - 4_000_000
    assert errors[200:].std() < 0.4e6
    assert np.abs(errors[200:]).max() < 1.2e6


@pytest.mark.parametrize("ppm", [-200, 200])
def test_a_camera_whose_clock_is_off_is_followed_without_drift(ppm):
    true = np.round(PERIOD_NS * (1 + ppm * 1e-6) * np.arange(20_000)).astype(np.int64)
    jitter = np.random.default_rng(3).normal(0, 2e6, 20_000)
    errors = run(FieldClock(PERIOD_NS), true + jitter) - true[1:]
    assert abs(errors[1_000:].mean()) < 0.05e6
    assert abs(errors[-2_000:].mean()) < 0.1e6


def test_the_period_never_leaves_the_nominal_one_by_more_than_half_a_per_cent():
    clock = FieldClock(PERIOD_NS)
    run(clock, 21_000_000 * np.arange(500))
    before_ns = clock.time_ns
    assert clock.advance(1) - before_ns <= 1.005 * PERIOD_NS + 1


def test_locking_anew_keeps_the_period():
    clock = FieldClock(PERIOD_NS)
    run(clock, np.round(1.0002 * PERIOD_NS * np.arange(5_000)).astype(np.int64))
    clock.lock(0)
    assert clock.advance(1_000) == pytest.approx(1_000 * 1.0002 * PERIOD_NS, abs=0.2e6)


@pytest.mark.parametrize("ppm", [-4000, -500, 500, 4000])
def test_the_rate_of_a_camera_and_how_well_it_is_known_are_learned_within_two_seconds(ppm):
    clock = FieldClock(PERIOD_NS)
    assert clock.period_sigma > 1e-3
    true = PERIOD_NS * (1 + ppm * 1e-6)
    run(
        clock,
        np.round(true * np.arange(100)).astype(np.int64)
        + np.random.default_rng(4).integers(0, 2_000_000, 100),
    )
    assert clock.period_sigma < 4e-4
    assert abs(clock.period_ns / true - 1) < 2 * clock.period_sigma


def test_a_period_that_has_varied_may_vary_again():
    n = np.arange(2000)
    jitter = np.random.default_rng(1).uniform(0, 2_000_000, len(n))
    steady, wandering = FieldClock(PERIOD_NS), FieldClock(PERIOD_NS)
    run(steady, n * PERIOD_NS * 1.001 + jitter)
    run(wandering, np.cumsum(PERIOD_NS * (1 + 0.001 * np.sin(n / 300))) + jitter)
    assert steady.wander < 3e-4
    assert 1.5e-3 < wandering.wander < 3e-3
