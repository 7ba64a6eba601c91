"""The ladder: which step is next, and how long to wait before it."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.documents.enums import DeviceState
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.device.recovery import (
    PROVEN_S,
    RESETS,
    RETRIES,
    RUNGS,
    Failure,
    Ladder,
    Rung,
    Step,
    Trouble,
    reason_of,
    trouble_of,
)
from grabberd.instrument.device.status_board import may_follow

STALLED_S = 1.0
"""How long it takes to see that a step has not helped."""


def climb(*failures: Failure, start: Ladder | None = None) -> Iterator[tuple[float, Step]]:
    """The steps taken for one failure after another, and when."""
    ladder, now_s = start or Ladder(), 0.0
    for failure in failures:
        now_s += STALLED_S + failure.flowed_s
        ladder, step = ladder.next(failure, round(now_s * 1e9))
        now_s += step.wait_s
        yield now_s, step


def rungs(*failures: Failure) -> list[Rung]:
    return [step.rung for _, step in climb(*failures)]


STALL = Failure(Trouble.STREAM, is_open=True, flowed_s=0.0)
AWAY = Failure(Trouble.ABSENT, is_open=False, flowed_s=0.0)
LOST = Failure(Trouble.ABSENT, is_open=True, flowed_s=100.0)
BUSY = Failure(Trouble.REFUSED, is_open=False, flowed_s=0.0)


def test_every_trouble_has_its_rungs_its_retries_and_a_state() -> None:
    assert set(RUNGS) == {(trouble, is_open) for trouble in Trouble for is_open in (True, False)}
    assert set(RETRIES) == set(Trouble)


def test_a_stalled_grabber_is_restarted_reopened_reset_and_then_tried_again() -> None:
    assert rungs(*[STALL] * 5) == [Rung.RESTART, Rung.REOPEN, Rung.RESET, Rung.RETRY, Rung.RETRY]


def test_the_first_steps_are_taken_at_once() -> None:
    assert [step.wait_s for _, step in climb(*[STALL] * 3)] == [0, 0, 0]


def test_it_is_recovering_while_it_is_helped_and_then_failed() -> None:
    states = [step.state for _, step in climb(*[STALL] * 4)]
    assert states == [DeviceState.RECOVERING] * 3 + [DeviceState.FAILED]


def test_a_field_after_each_step_does_not_lead_back_to_the_first_rung() -> None:
    briefly = STALL._replace(flowed_s=PROVEN_S - 1)
    assert rungs(*[briefly] * 4) == [Rung.RESTART, Rung.REOPEN, Rung.RESET, Rung.RETRY]


def test_fields_for_some_time_do() -> None:
    assert rungs(STALL, STALL, STALL._replace(flowed_s=PROVEN_S)) == [
        Rung.RESTART,
        Rung.REOPEN,
        Rung.RESTART,
    ]


def test_a_lost_device_is_opened_again_at_once_and_then_within_a_second_of_its_return() -> None:
    steps = [step for _, step in climb(LOST, *[AWAY] * 100)]
    assert steps[0] == Step(Rung.REOPEN, 0.0, DeviceState.RECOVERING)
    assert {step.state for step in steps[1:]} == {DeviceState.ABSENT}
    assert [step.wait_s for step in steps[1:5]] == [0.25, 0.5, 1.0, 1.0]
    assert max(step.wait_s for step in steps) <= 1.0


def test_a_refusal_is_tried_again_more_and_more_seldom() -> None:
    steps = [step for _, step in climb(*[BUSY] * 8)]
    assert {(step.rung, step.state) for step in steps} == {(Rung.RETRY, DeviceState.FAILED)}
    assert [step.wait_s for step in steps] == [0.5, 1, 2, 4, 8, 10, 10, 10]


def test_after_a_reset_the_device_is_waited_for_before_it_is_called_absent_or_refused() -> None:
    *_, (_, away), (_, no_rights_yet) = climb(STALL, STALL, STALL, AWAY, BUSY)
    assert away == Step(Rung.RETRY, 0.25, DeviceState.RECOVERING)
    assert no_rights_yet == Step(Rung.RETRY, 0.5, DeviceState.RECOVERING)
    late = [step.state for _, step in climb(STALL, STALL, STALL, *[AWAY] * 20)]
    assert late[-1] is DeviceState.ABSENT


def test_a_refusal_just_after_a_reset_is_waited_out_like_an_absence() -> None:
    steps = [step for _, step in climb(STALL, STALL, STALL, AWAY, BUSY, BUSY, BUSY)][3:]
    assert [step.wait_s for step in steps] == [0.25, 0.5, 1.0, 1.0]
    assert {step.state for step in steps} == {DeviceState.RECOVERING}


def test_another_trouble_begins_its_retries_anew() -> None:
    *_, (_, step) = climb(*[AWAY] * 1000, BUSY)
    assert step.wait_s == 0.5


def test_absent_for_a_year_it_is_still_tried_again() -> None:
    ladder = Ladder(Trouble.ABSENT, retries=30_000_000)
    assert next(climb(AWAY, start=ladder))[1].wait_s == 1.0


def test_errors_are_sorted_by_what_can_be_done() -> None:
    assert [trouble_of(kind("", "")) for kind in (StreamFailed, DeviceLost, DeviceAbsent, DeviceRefused)] == [
        Trouble.STREAM,
        Trouble.ABSENT,
        Trouble.ABSENT,
        Trouble.REFUSED,
    ]


def test_the_ledger_says_unplugged_or_what_the_error_says() -> None:
    assert reason_of(DeviceLost("/dev/video7 is gone", "")) == "unplugged"
    assert reason_of(StreamFailed("no field for 0.8 s", "")) == "no field for 0.8 s"


failures = st.lists(
    st.builds(Failure, st.sampled_from(Trouble), st.booleans(), st.sampled_from([0.0, 0.5, 9.0, 15.0])),
    max_size=200,
)


@given(failures)
def test_resets_are_never_nearer_than_their_own_back_off(script: list[Failure]) -> None:
    resets = [at_s for at_s, step in climb(*script) if step.rung is Rung.RESET]
    assert all(later - earlier >= RESETS.first_s for earlier, later in pairwise(resets))


@given(failures)
def test_a_device_that_is_not_open_is_not_restarted(script: list[Failure]) -> None:
    for failure, (_, step) in zip(script, climb(*script), strict=True):
        assert failure.is_open or step.rung is not Rung.RESTART


@given(failures)
def test_waits_never_exceed_their_limit_and_only_retries_wait(script: list[Failure]) -> None:
    for failure, (_, step) in zip(script, climb(*script), strict=True):
        assert step.wait_s <= RETRIES[failure.trouble].longest_s
        assert (step.wait_s > 0) == (step.rung is Rung.RETRY)


@given(failures)
def test_every_step_leads_to_a_state_that_may_follow_one_of_trouble_or_streaming(
    script: list[Failure],
) -> None:
    for _, step in climb(*script):
        assert may_follow(DeviceState.CAPTURING, step.state)
        assert may_follow(DeviceState.OPENING, step.state)


@given(failures)
def test_an_absent_device_is_never_reset(script: list[Failure]) -> None:
    for failure, (_, step) in zip(script, climb(*script), strict=True):
        assert failure.trouble is Trouble.STREAM or step.rung is not Rung.RESET


def test_in_a_day_of_stalls_resets_become_seldom() -> None:
    steps = [(at_s, step) for at_s, step in climb(*[STALL] * 86_400) if at_s < 24 * 3600]
    resets = [at_s for at_s, step in steps if step.rung is Rung.RESET]
    assert 24 <= len(resets) <= 32
    assert [round(later - earlier, -1) for earlier, later in pairwise(resets[:4])] == pytest.approx(
        [60, 120, 240], abs=40
    )
