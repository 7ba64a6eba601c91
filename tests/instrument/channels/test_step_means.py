"""Readings are averaged over the time of a field, and the last minutes of them are kept."""

import numpy as np
import pytest

from grabberd.instrument.channels.feed import STEP_NS, STEPS, StepMeans

MS_NS = 1_000_000


def test_readings_of_one_step_become_their_mean_however_they_came() -> None:
    means = StepMeans(2)
    means.add(np.array([MS_NS, 2 * MS_NS]), np.array([[40.0, 1.0], [42.0, np.nan]]))
    means.add(np.array([3 * MS_NS, STEP_NS + MS_NS]), np.array([[44.0, 3.0], [10.0, np.nan]]))
    time_ns, kpa = means.since(0, 0)
    assert time_ns.tolist() == [STEP_NS // 2, STEP_NS + STEP_NS // 2]
    assert kpa.tolist() == [42.0, 10.0]
    assert [one.tolist() for one in means.since(0, 1)] == [[STEP_NS // 2], [2.0]]


def test_a_gap_stays_one() -> None:
    means = StepMeans(1)
    means.add(np.array([0, 10 * STEP_NS]), np.array([[1.0], [2.0]]))
    assert means.since(0, 0)[0].tolist() == [STEP_NS // 2, 10 * STEP_NS + STEP_NS // 2]


def test_what_is_older_than_it_keeps_is_forgotten_and_does_not_come_back_into_a_mean() -> None:
    means = StepMeans(1)
    means.add(np.array([0, STEP_NS]), np.array([[1.0], [2.0]]))
    means.add(np.array([STEPS * STEP_NS]), np.array([[9.0]]))
    time_ns, kpa = means.since(0, 0)
    assert kpa.tolist() == [2.0, 9.0]
    assert time_ns[-1] == STEPS * STEP_NS + STEP_NS // 2


@pytest.mark.parametrize("since_ns", [3 * STEP_NS, 3 * STEP_NS + MS_NS])
def test_steps_since_a_time_are_given(since_ns: int) -> None:
    means = StepMeans(1)
    means.add(np.arange(6) * STEP_NS, np.arange(6.0)[:, None])
    assert means.since(since_ns, 0)[1].tolist() == [3.0, 4.0, 5.0]
