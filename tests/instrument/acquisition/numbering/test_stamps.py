"""Timestamps that are not believed: which they are, and how their fields are numbered all the same."""

import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import Outcome
from instrument.acquisition.streams import (
    MS,
    PERIOD_NS,
    START_NS,
    Numbering,
    grab,
    info,
    lost,
    numbers,
    numbers_in_time,
)


@pytest.mark.parametrize(
    ("time_ns", "doubt"),
    [
        (0, "zero timestamp"),
        (START_NS - 40 * MS, "backward timestamp"),
        (START_NS + 3_600_000 * MS, "far-off timestamp"),
    ],
)
def test_a_bad_timestamp_is_replaced_by_the_predicted_time_and_named(time_ns, doubt):
    found = numbers([grab(0), grab(1), grab(2, time_ns=time_ns), grab(3)])
    assert [field.n for field in found] == [0, 1, 2, 3]
    assert found[2].time_ns == START_NS + 2 * PERIOD_NS
    assert (found[2].outcome, found[2].reason) == (Outcome.RECEIVED, f"time predicted ({doubt})")
    assert found[3].reason is None


def test_a_timestamp_out_of_the_future_is_not_believed_even_where_it_could_be_a_gap():
    numbering = Numbering(info())
    numbering.number(grab(0), now_ns=START_NS)
    found = numbering.number(grab(1, late_ns=1_000 * MS), now_ns=START_NS + PERIOD_NS)
    assert (found.n, found.time_ns) == (1, START_NS + PERIOD_NS)
    assert found.reason == "time predicted (far-off timestamp)"


@pytest.mark.parametrize(
    ("ahead_ms", "doubt"), [(100, None), (101, "far-off timestamp"), (299, "far-off timestamp")]
)
def test_a_stamp_may_be_a_tenth_of_a_second_ahead_of_its_arrival_and_no_more(ahead_ms, doubt):
    numbering = Numbering(info())
    for n in range(30):
        numbering.see(grab(n, late_ns=ahead_ms * MS if n == 20 else 0), now_ns=grab(n).time_ns)
    found = numbering.settled()[20]
    assert found.reason == f"time predicted ({doubt or 'late timestamp'})"
    assert found.n == 20


@pytest.mark.parametrize(("seconds", "believed"), [(10.0, True), (10.04, False)])
def test_a_live_stamp_after_more_than_ten_silent_seconds_is_believed_if_the_arrival_confirms_it(
    seconds, believed
):
    gap = round(50 * seconds)
    kept = [0, *range(gap, gap + 20)]
    assert [field.n for field in numbers_in_time(kept)] == kept
    found = numbers(grab(n) for n in kept)[1]
    assert (found.n == gap) is believed


@pytest.mark.parametrize(("before_ms", "doubt"), [(29, None), (31, "backward timestamp")])
def test_a_stamp_more_than_a_period_and_a_half_before_the_last_counts_as_backward(before_ms, doubt):
    found = numbers([grab(0), grab(1), grab(2, time_ns=START_NS + PERIOD_NS - before_ms * MS)])[-1]
    assert (found.reason == "time predicted (backward timestamp)") is (doubt is not None)


def test_the_first_field_of_a_live_stream_needs_a_stamp_above_zero():
    assert Numbering(info()).number(grab(0, time_ns=1)).reason is None
    assert Numbering(info()).number(grab(0, time_ns=0)).reason == "time predicted (zero timestamp)"


def test_doubted_stamps_that_disagree_among_themselves_are_never_taken_for_another_clock():
    far_ms = 3_600_000
    fields = [grab(n) for n in range(3)]
    fields += [grab(n, late_ns=(1 + n % 2 / 50) * far_ms * MS) for n in range(3, 12)]
    assert all(field.reason for field in numbers(fields)[3:])


def test_two_doubted_stamps_are_too_few_for_another_clock():
    jump = {5: 3_600_000 * MS, 6: 3_600_000 * MS}
    found = numbers(grab(n, late_ns=jump.get(n, 0)) for n in range(10))
    assert [field.reason is None for field in found] == [True] * 5 + [False] * 2 + [True] * 3
    assert [field.time_ns for field in found] == [START_NS + n * PERIOD_NS for n in range(10)]


def test_an_interruption_longer_than_any_gap_is_measured_by_the_next_stamp():
    numbering = Numbering(info())
    numbering.number(grab(0))
    numbering.interrupt("unplugged")
    for n in range(100_000, 100_010):
        numbering.see(grab(n))
    found = numbering.settled()[1]
    assert (found.n, found.reason) == (100_000, None)
    assert lost(found.lost_before) == [(1, 99_999, "unplugged")]
    assert numbering.number(grab(100_013)).lost_before[0].reason == "time gap"


def test_a_world_that_runs_ahead_of_our_clock_is_believed():
    numbering = Numbering(info(waits=True))
    kept = [0, 1, 2, *range(50, 60)]
    for n in kept:
        numbering.see(grab(n), now_ns=START_NS)
    found = numbering.settled()
    assert [field.n for field in found] == kept
    assert all(field.reason is None for field in found)


def test_without_time_the_count_tells_of_losses():
    stream = info(FieldOrder.TOP_FIRST, counts_losses=True)
    fields = [grab(n, sequence=n, time_ns=None if n < 2 else 0) for n in (0, 1, 4)]
    found = numbers(fields, stream)[-1]
    assert (found.n, lost(found.lost_before)) == (4, [(2, 2, "sequence gap")])
    assert found.time_ns == START_NS + 4 * PERIOD_NS


def test_without_time_and_count_a_repeated_parity_tells_of_a_loss():
    found = numbers([grab(0), grab(1), grab(3, time_ns=0)])[-1]
    assert (found.n, lost(found.lost_before)) == (3, [(2, 1, "repeated parity")])


def test_a_device_that_never_tells_the_time_is_numbered_by_parity():
    numbering = Numbering(info())
    found = [numbering.number(grab(n, time_ns=0), now_ns=START_NS + n * PERIOD_NS) for n in range(20)]
    assert [field.n for field in found] == list(range(20))
    assert found[-1].time_ns == START_NS + 19 * PERIOD_NS - 1.5 * PERIOD_NS, (
        "the way from exposure to arrival"
    )
    assert all(field.reason == "time predicted (zero timestamp)" for field in found)


@pytest.mark.parametrize("jump_ns", [-3_600_000 * MS, 3_600_000 * MS])
def test_times_of_another_clock_are_shifted_to_continue_the_first(jump_ns):
    fields = [grab(n) for n in range(5)] + [grab(n, late_ns=jump_ns) for n in range(5, 20)]
    found = numbers(fields)
    assert [field.n for field in found] == list(range(20))
    assert [field.time_ns for field in found] == [START_NS + n * PERIOD_NS for n in range(20)]
    assert [field.reason is None for field in found] == [True] * 5 + [False] * 3 + [True] * 12


@pytest.mark.parametrize(("apart_ms", "taken"), [(9, True), (11, False)])
def test_stamps_of_another_clock_agree_if_they_lie_within_half_a_period(apart_ms, taken):
    fields = [grab(n) for n in range(3)]
    fields += [grab(n, late_ns=(3_600_000 + n % 2 * apart_ms) * MS) for n in range(3, 12)]
    assert [field.reason is None for field in numbers(fields)[3:]] == [False] * 3 + [taken] * 6


def test_one_other_clock_may_follow_another():
    jump_ns = [0] * 5 + [3_600_000 * MS] * 10 + [1_800_000 * MS] * 10
    found = numbers(grab(n, late_ns=late_ns) for n, late_ns in enumerate(jump_ns))
    assert [field.time_ns for field in found] == [START_NS + n * PERIOD_NS for n in range(25)]
    assert [n for n, field in enumerate(found) if field.reason] == [5, 6, 7, 15, 16, 17]


@pytest.mark.parametrize("jump_ns", [-3_600_000 * MS, 3_600_000 * MS])
def test_a_zero_stamp_is_called_one_after_another_clock_has_taken_over_too(jump_ns):
    fields = [grab(n) for n in range(5)] + [grab(n, late_ns=jump_ns) for n in range(5, 20)]
    found = numbers([*fields, grab(20, time_ns=0)])
    assert found[-1].reason == "time predicted (zero timestamp)"
    assert found[-1].time_ns == START_NS + 20 * PERIOD_NS
