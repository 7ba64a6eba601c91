"""Cycle length and phase from the wall's movement, of captures and of bursts."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from core.chain.fake_scene import take_scene
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.pulsation.movement import TimedPoints, first_movement
from grabberd_liner.analysis.pulsation.phase_average import variation
from grabberd_liner.analysis.pulsation.pulsation import fit_pulsation
from liner.analysis.pulsating import burst_times, capture, times


def pulsation(*captures, **limits):
    return fit_pulsation(first_movement(captures), **limits)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(st.floats(0.6, 1.8), st.floats(0, 5), st.integers(0, 100))
def test_the_cycle_length_of_a_few_cycles_is_good_to_a_millisecond(
    period_s: float, start_s: float, seed: int
) -> None:
    found = pulsation(capture(times(200, start_s), 0.03, seed=seed, period_s=period_s))
    assert found.period_s == pytest.approx(period_s, abs=1e-3)
    assert abs(found.period_s - period_s) < 5 * found.period_sigma_s + 2e-4
    assert found.rate_per_min.value == pytest.approx(60 / period_s, rel=1e-3)


@pytest.mark.slow
def test_sigma_of_the_cycle_length_is_what_noise_makes_of_it() -> None:
    found = [pulsation(capture(times(120), 0.05, seed=seed)) for seed in range(8)]
    left = np.array([(one.period_s - 1.0) / one.period_sigma_s for one in found])
    assert 0.5 < np.sqrt((left**2).mean()) < 1.7


def test_points_as_noisy_as_those_of_one_bit_do_too() -> None:
    found = pulsation(capture(times(150), 0.12, missing=0.2))
    assert found.period_s == pytest.approx(1.0, abs=2e-3)
    assert found.period_sigma_s < 1e-3


def test_a_long_capture_is_followed_to_its_end() -> None:
    found = pulsation(capture(times(1500), period_s=0.9371))
    assert found.period_s == pytest.approx(0.9371, abs=5e-5)
    assert found.cycles == pytest.approx(32, abs=0.1)


def test_phase_counts_from_where_the_wall_begins_to_open() -> None:
    """Ten percent of the stroke, 29.4 ms after the wall stirs."""
    found = pulsation(capture(times(200)))
    at = found.at(np.array([0.2, 0.0794 + 1, 0.7294 + 2, 99.0]))
    assert_allclose(at.phase[:3] % 1, [0.1706, 0.05, 0.7], atol=2e-3)
    assert at.run.tolist() == [0, 0, 0, -1]
    assert np.isnan(at.phase[3])
    assert at.cycle[2] - at.cycle[0] == 2


def test_missing_fields_are_no_problem() -> None:
    keep = np.ones(300, bool)
    keep[20:30] = keep[47] = keep[200:220] = False
    fields = capture(times(300)[keep])
    found = pulsation(fields)
    assert found.period_s == pytest.approx(1.0, abs=5e-4)
    assert len(found.runs) == 1


def test_a_gap_longer_than_a_cycle_resets_the_count() -> None:
    keep = np.ones(400, bool)
    keep[150:220] = False
    fields = capture(times(400)[keep])
    found = pulsation(fields)
    assert [run.capture for run in found.runs] == [0, 0]
    at = found.at(np.array([2.0, 6.0]))
    assert at.run.tolist() == [0, 1]
    assert at.cycle[1] < 3


def test_bursts_of_32_fields_find_their_places_in_one_cycle() -> None:
    starts_s = (0.0, 0.31, 0.55, 0.72, 1.9, 2.03)
    found = pulsation(*[capture(time_s, seed=k) for k, time_s in enumerate(burst_times(starts_s))])
    assert found.period_s == pytest.approx(1.0, abs=1e-3)
    assert found.period_sigma_s < 1e-3
    begun = np.array([run.start_s for run in found.runs])
    assert_allclose(begun - np.round(begun), 0.0294, atol=2e-3)
    assert [run.capture for run in found.runs] == list(range(6))


def test_bursts_of_one_capture_far_apart_do_as_well() -> None:
    fields = capture(np.concatenate(burst_times((0.0, 7.31, 12.55, 17.72, 21.9, 30.03))))
    found = pulsation(fields)
    assert found.period_s == pytest.approx(1.0, abs=1e-3)
    assert len(found.runs) == 6


@pytest.mark.parametrize(
    ("fields", "start_s"), [(20, 0.0), (30, 0.6), (40, 0.4), (44, 0.0), (48, 0.2), (60, 0.2)]
)
def test_a_capture_that_shows_no_movement_twice_is_refused(fields: int, start_s: float) -> None:
    """The last one is longer than a cycle, but only the open liner is seen again."""
    with pytest.raises(AnalysisError, match="do not show a cycle and enough of the next") as caught:
        pulsation(capture(times(fields, start_s + 0.003)))
    assert "one and a half cycles" in caught.value.hint


def test_a_capture_in_which_nothing_moves_has_no_place_in_the_cycle_of_its_bursts() -> None:
    still, moving = capture(times(8, 0.25)), [capture(times(100, start)) for start in (0.0, 0.31)]
    found = pulsation(still, *moving)
    assert [np.isfinite(run.start_sigma_s) for run in found.runs] == [False, True, True]
    with pytest.raises(AnalysisError, match="show no movement") as caught:
        found.reached_s(np.array([0.0]))
    assert "opens or closes" in caught.value.hint


def test_phases_are_reached_at_the_times_of_the_first_capture() -> None:
    found = pulsation(capture(times(100, 0.0)), capture(times(100, 0.5)))
    reached_s = found.reached_s(np.array([0.25, 0.75]))
    assert_allclose(found.at(reached_s).phase, [0.25, 0.75], atol=1e-9)
    assert found.runs[0].first_s <= reached_s.min()
    assert reached_s.max() < found.runs[0].first_s + 2 * found.period_s


def test_two_bursts_that_share_nothing_that_moves_are_refused() -> None:
    with pytest.raises(AnalysisError, match="enough of the next"):
        pulsation(*[capture(time_s) for time_s in burst_times((0.0, 0.31))])


def test_where_nothing_pulsates_that_is_said() -> None:
    with pytest.raises(AnalysisError, match="nothing pulsates") as caught:
        pulsation(capture(times(100), deflection_mm=0.0))
    assert "pulsator" in caught.value.hint


def test_what_does_not_repeat_itself_is_refused() -> None:
    uneven = (
        capture(times(80)) + capture(times(80, 2.0), period_s=2.3) + capture(times(80, 4.0), period_s=0.7)
    )
    with pytest.raises(AnalysisError, match=r"repeat itself|enough of the next"):
        pulsation(uneven)


def test_cycles_that_are_alike_vary_by_their_noise() -> None:
    movements = first_movement([capture(times(400))])
    found = variation(movements, fit_pulsation(movements))
    assert len(found.lengths_s.value) == 7
    assert_allclose(found.lengths_s.value, 1.0, atol=1e-3)
    assert_allclose(found.stroke.value, 1.0, atol=3e-3)


def test_a_late_cycle_is_seen() -> None:
    at_s = times(400)
    late_s = np.where((at_s > 4) & (at_s < 5), at_s - 0.01, at_s)
    fields = [f._replace(time_s=t) for f, t in zip(capture(late_s), at_s, strict=True)]
    movements = first_movement([fields])
    found = variation(movements, fit_pulsation(movements))
    late = np.abs(found.start_s.value - 4.03) < 0.2
    lengths = found.lengths_s.value
    assert (lengths.max(), lengths.min()) == (pytest.approx(1.01, abs=3e-3), pytest.approx(0.99, abs=3e-3))
    assert late.sum() == 1


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "lines", "good_s"), [(8, "field", 5e-4), (1, "doubled", 2e-3)])
def test_pictures_of_two_cycles_tell_the_cycle_length(bits: int, lines: str, good_s: float) -> None:
    scene = pictures()
    fields = [TimedPoints(one.time_ns / 1e9, one.points) for one in scene.measured(bits, lines)]
    found = pulsation(fields)
    assert found.period_s == pytest.approx(0.97, abs=good_s)
    assert abs(found.period_s - 0.97) < 4 * found.period_sigma_s


@cache
def pictures():
    return take_scene(90, seed=3, liner={"period_s": 0.97})
