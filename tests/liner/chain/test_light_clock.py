"""The light of the simulated camera: found among moving targets, and dated by."""

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.errors import AnalysisError, InputError
from grabberd_fake.light_options import LightOptions, lit
from grabberd_liner.analysis.vacuum.light_clock import LightSignal, find_light, logged_light, steady_times

PLACE = {"diameter_px": 9.0, "x_px": 640.0, "y_px": 24.0}
SECONDS = 14


@pytest.fixture(scope="module")
def scene():
    return take_scene(SECONDS * 50, light=PLACE)


def logged(first_ns, offset_s, seed=1, rate_hz=500.0):
    """The lamp's state on a clock that is `offset_s` behind seconds since the first field."""
    since_s = np.arange(-2, SECONDS + 2, 1 / rate_hz)
    states = lit(LightOptions(**PLACE, seed=seed), first_ns + np.rint(since_s * 1e9).astype(np.int64))
    return LightSignal(since_s - offset_s, states)


@pytest.mark.parametrize(("bits", "lines"), [(1, "doubled"), (1, "field"), (8, "field")])
def test_it_is_found_by_what_the_logger_recorded(scene, bits: int, lines: str) -> None:
    first_ns = scene.fields[0][0]
    found = find_light(scene.packed(bits, lines), first_ns, logged(first_ns, 3.21))
    assert found.x_px == pytest.approx(PLACE["x_px"], abs=3)
    assert found.y_px == pytest.approx(PLACE["y_px"], abs=6)
    assert found.clock.offset_s == pytest.approx(3.21, abs=1.5e-3)
    assert abs(found.clock.offset_s - 3.21) < 3.5 * found.clock.offset_sigma_s
    assert found.clock.offset_sigma_s < 6e-4


def test_points_are_as_good_as_without_it(scene) -> None:
    dark = take_scene(60)
    found = [len(one.points) for one in scene.measured(1, "doubled")[:60]]
    assert found == [len(one.points) for one in dark.measured(1, "doubled")]


def test_moving_targets_alone_are_no_light(scene) -> None:
    dark = take_scene(150)
    first_ns = dark.fields[0][0]
    with pytest.raises(AnalysisError, match=r"at no offset|no place|several offsets"):
        find_light(dark.packed(1, "doubled"), first_ns, logged(first_ns, 0.0))


def test_another_light_than_that_of_the_log_is_refused(scene) -> None:
    first_ns = scene.fields[0][0]
    with pytest.raises(AnalysisError, match="at no offset"):
        find_light(scene.packed(1, "field"), first_ns, logged(first_ns, 0.0, seed=2))


def test_a_logs_light_may_be_in_any_unit() -> None:
    time_s, on = np.arange(200) / 100, np.random.default_rng(1).random(200) < 0.5
    noisy = np.where(on, 3.3, 0.2) + np.random.default_rng(2).normal(0, 0.05, 200)
    assert (logged_light(time_s, noisy).lit == on).all()


@pytest.mark.parametrize("level", [np.full(200, 1.0), np.linspace(0, 5, 200)])
def test_a_log_without_two_states_is_refused(level) -> None:
    with pytest.raises(InputError, match="two states"):
        logged_light(np.arange(200) / 100, level)


def test_stamps_that_scatter_and_are_late_now_and_then_become_equal_steps() -> None:
    rng = np.random.default_rng(1)
    number = np.delete(np.arange(1500), slice(700, 800))
    true_s = 3.0 + 0.020001 * number
    late_s = np.where(rng.random(len(number)) < 0.05, rng.exponential(0.03, len(number)), 0.0)
    steady = steady_times(number, true_s + rng.normal(0, 1e-3, len(number)) + late_s)
    assert np.abs(steady - true_s).max() < 2.5e-4


def test_a_film_that_was_cut_keeps_its_times() -> None:
    number = np.arange(200)
    time_s = 0.02 * number + np.where(number > 100, 5.0, 0.0)
    assert (steady_times(number, time_s) == time_s).all()
