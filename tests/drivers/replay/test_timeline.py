"""Pictures get their numbers by their own times: against numbers and times that a formula gives."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd.core.field import NTSC_HZ
from grabberd.errors import PictureError
from grabberd_replay.timeline import LOOKED_AT, Numbered, Pace, Timeline, apart_ms

COUNT = 300
RATES_HZ = (25.0, NTSC_HZ / 2, 60.0, 240.0)
ALL = np.arange(COUNT)
WITH_GAPS = np.delete(ALL, [1, 2, 10, 70, 71, 72, 200])
UNCERTAIN = "number uncertain by up to 1"

every_rate = pytest.mark.parametrize("rate_hz", RATES_HZ)


def paced(times_s: Sequence[float]) -> Pace:
    pace = Pace.of(times_s[:LOOKED_AT])
    assert pace is not None
    return pace


def numbered(times_s: NDArray[np.float64], steps: int = 1) -> list[Numbered[int]]:
    """Every picture with its number; the picture is its place among the times."""
    times = [float(one) for one in times_s]
    timeline: Timeline[int] = Timeline("clip", paced(times), steps)
    decided = [one for at, time_s in enumerate(times) for one in timeline.take(at, time_s)]
    return [*decided, *timeline.end()]


def numbers(found: Sequence[Numbered[int]]) -> list[int]:
    return [one.number for one in found]


def uncertain(found: Sequence[Numbered[int]]) -> list[int]:
    assert {one.damage for one in found} <= {None, UNCERTAIN}
    return [one.picture for one in found if one.damage]


# --- what is lost ---


@every_rate
def test_pictures_at_a_steady_rate_are_consecutive_and_at_their_own_times(rate_hz: float) -> None:
    found = numbered(ALL / rate_hz)
    assert numbers(found) == list(range(COUNT))
    assert [one.picture for one in found] == list(range(COUNT))
    assert [one.time_s for one in found] == pytest.approx(ALL / rate_hz, abs=1e-6)
    assert uncertain(found) == []


@every_rate
def test_a_gap_of_whole_periods_is_lost_pictures(rate_hz: float) -> None:
    found = numbered(WITH_GAPS / rate_hz)
    assert numbers(found) == WITH_GAPS.tolist()
    assert uncertain(found) == []


@every_rate
def test_gaps_are_found_in_times_of_whole_milliseconds(rate_hz: float) -> None:
    found = numbered(np.round(WITH_GAPS / rate_hz, 3))
    assert numbers(found) == WITH_GAPS.tolist()
    assert uncertain(found) == []


@every_rate
def test_gaps_are_found_in_times_that_jitter_and_the_jitter_is_smoothed(rate_hz: float) -> None:
    jitter = np.random.default_rng(0).uniform(-0.1, 0.1, COUNT) / rate_hz
    found = numbered(WITH_GAPS / rate_hz + jitter[WITH_GAPS])
    assert numbers(found) == WITH_GAPS.tolist()
    assert uncertain(found) == []
    late_s = np.array([one.time_s for one in found]) - WITH_GAPS / rate_hz
    assert late_s.std() < jitter.std() / 2


@every_rate
def test_every_third_picture_dropped_is_so_many_lost_ones(rate_hz: float) -> None:
    kept = ALL[ALL % 3 != 2]
    assert numbers(numbered(kept / rate_hz)) == kept.tolist()


@every_rate
def test_a_third_dropped_at_random_is_so_many_lost_ones(rate_hz: float) -> None:
    kept = np.sort(np.random.default_rng(1).choice(COUNT, 200, replace=False))
    assert numbers(numbered(kept / rate_hz)) == (kept - kept[0]).tolist()


@every_rate
def test_after_a_gap_of_no_whole_periods_the_number_is_uncertain_and_the_times_go_on(rate_hz: float) -> None:
    times_s = np.where(ALL < 100, ALL, ALL + 3.5) / rate_hz
    found = numbered(times_s)
    assert uncertain(found) == [100]
    assert numbers(found)[:100] == list(range(100))
    assert numbers(found)[100] in (103, 104)
    assert np.diff(numbers(found)[100:]).tolist() == [1] * (COUNT - 101)
    assert [one.time_s for one in found[100:]] == pytest.approx(times_s[100:], abs=0.01 / rate_hz)


@every_rate
@pytest.mark.parametrize(("gap", "lost"), [(2.8, 3), (3.2, 3), (3.3, 3)])
def test_a_gap_of_nearly_whole_periods_is_the_nearest_number_of_them(
    rate_hz: float, gap: float, lost: int
) -> None:
    found = numbered(np.where(ALL < 100, ALL, ALL + gap) / rate_hz)
    assert numbers(found) == np.where(ALL < 100, ALL, ALL + lost).tolist()


# --- the pace ---


@every_rate
def test_the_rate_of_a_standard_is_found_exactly(rate_hz: float) -> None:
    assert paced((ALL / rate_hz).tolist()).period_s == 1 / rate_hz
    assert paced(np.round(WITH_GAPS / rate_hz, 3).tolist()).period_s == pytest.approx(1 / rate_hz, rel=1e-4)


@every_rate
@pytest.mark.parametrize("fast", [0.998, 1.002])
def test_an_even_drift_is_the_camera_s_pace_and_no_loss(rate_hz: float, fast: float) -> None:
    found = numbered(ALL / (rate_hz * fast))
    assert numbers(found) == list(range(COUNT))
    assert [one.time_s for one in found] == pytest.approx(ALL / (rate_hz * fast), abs=0.05 / rate_hz)


def test_a_stated_rate_may_be_a_multiple_of_that_of_the_pictures() -> None:
    found = numbered(WITH_GAPS / 25, steps=2)
    assert numbers(found) == (2 * WITH_GAPS).tolist()


@pytest.mark.parametrize("times_s", [[0.0], [0.5, 0.5, 0.5]])
def test_without_two_different_times_there_is_no_pace(times_s: list[float]) -> None:
    assert Pace.of(times_s) is None


def test_times_without_a_rate_are_not_steady() -> None:
    at_random = np.sort(np.random.default_rng(2).uniform(0, 2, LOOKED_AT))
    assert not paced(at_random.tolist()).is_steady
    assert paced((ALL / 25).tolist()).is_steady


def test_the_least_and_the_greatest_step_between_pictures_are_told_in_ms() -> None:
    assert apart_ms([0.0, 0.04, 0.1, 0.12]) == pytest.approx((20.0, 60.0))


# --- times that are off ---


@every_rate
def test_a_picture_that_was_stamped_late_keeps_its_number_and_its_time(rate_hz: float) -> None:
    late = np.where(ALL % 20 == 7, 0.8, 0.0)
    found = numbered((ALL + late) / rate_hz)
    assert numbers(found) == list(range(COUNT))
    assert uncertain(found) == []
    assert [one.time_s for one in found] == pytest.approx(ALL / rate_hz, abs=0.02 / rate_hz)


@every_rate
@pytest.mark.parametrize("late", [0.3, 0.8, 1.4])
def test_a_first_picture_that_was_stamped_late_is_dated_by_the_others(rate_hz: float, late: float) -> None:
    found = numbered((ALL + np.where(ALL == 0, late, 0.0)) / rate_hz)
    assert numbers(found) == list(range(COUNT))
    assert [one.time_s for one in found] == pytest.approx(ALL / rate_hz, abs=0.02 / rate_hz)
    assert found[0].time_s == 0.0


@pytest.mark.parametrize("own_time", [None, 0.0])
def test_a_picture_whose_time_does_not_pass_the_one_before_simply_follows(own_time: float | None) -> None:
    timeline: Timeline[int] = Timeline("clip", paced((ALL / 25).tolist()))
    times = [own_time if at in (30, 31) else at / 25 for at in range(60)]
    found = [one for at, time_s in enumerate(times) for one in timeline.take(at, time_s)]
    assert numbers([*found, *timeline.end()]) == list(range(60))


@every_rate
@pytest.mark.parametrize("slower", [0.5, 0.75, 0.8, 1.5])
def test_a_change_of_the_rate_ends_it_with_the_time_at_which_it_came(rate_hz: float, slower: float) -> None:
    times_s = np.where(ALL < 100, ALL, 100 + (ALL - 100) * slower) / rate_hz
    timeline: Timeline[int] = Timeline("clip", paced(times_s.tolist()))
    decided = (one for at, time_s in enumerate(times_s.tolist()) for one in timeline.take(at, time_s))
    found: list[Numbered[int]] = []
    with pytest.raises(PictureError, match=r"clip: about \d+\.\d+ s its pictures no longer come") as caught:
        found.extend(decided)
    assert numbers(found)[:100] == list(range(100))
    assert len(found) < 130
    assert "constant rate" in caught.value.hint


def test_a_time_that_no_recording_lasts_is_refused() -> None:
    timeline: Timeline[int] = Timeline("clip", paced((ALL / 25).tolist()))
    list(timeline.take(0, 0.0))
    with pytest.raises(PictureError, match="100000000000 s after the start"):
        list(timeline.take(1, 1e11))
