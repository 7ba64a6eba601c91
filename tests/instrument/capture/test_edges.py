"""Where a capture's account begins and ends."""

from dataclasses import replace

from slots import PERIOD_NS, slot

from grabberd.core.ledger import LedgerEntry, LedgerEvent, Outcome, Slot, numbers_off, numbers_unsure
from grabberd.instrument.acquisition import Ring
from grabberd.instrument.capture.recorder import Begin, NumbersFromBegin, cut, fields_before, number_at


def begin_at(fields: float) -> Begin:
    return Begin(round(fields * PERIOD_NS), PERIOD_NS)


def test_a_capture_begins_with_the_first_field_that_is_not_older_than_asked_for() -> None:
    assert [begin_at(10.0).first_n(slot(n)) for n in (8, 9, 10)] == [10, 10, 10]
    assert begin_at(9.01).first_n(slot(10)) == 10
    assert begin_at(10.01).first_n(slot(10)) == 11


def test_what_was_lost_between_the_begin_and_the_first_field_belongs_to_it() -> None:
    assert begin_at(10.0).first_n(slot(40, lost_before=35)) == 10
    assert begin_at(2.0).first_n(slot(40, lost_before=35)) == 5


def test_what_the_ring_has_never_had_is_not_missing() -> None:
    assert begin_at(10.0).first_n(slot(40)) == 40


def test_where_times_are_not_those_of_the_clock_it_begins_with_what_comes() -> None:
    assert Begin(None, PERIOD_NS).first_n(slot(40, lost_before=35)) == 40


def test_the_number_at_a_time_is_that_of_the_first_field_that_is_not_before_it() -> None:
    found = [number_at(slot(10), round(at * PERIOD_NS), PERIOD_NS) for at in (8.0, 8.01, 10.0, 12.0, 12.01)]
    assert found == [8, 9, 10, 12, 13]


def test_the_fields_before_a_trigger_are_counted_up_to_its_instant() -> None:
    ring = Ring(8)
    for n in range(10):
        ring.put(slot(n))
    trigger_ns = 12 * PERIOD_NS  # two fields are still on their way
    reader = ring.reader(back=5)
    assert fields_before(reader, ring.newest, begin_at(12 - 5), trigger_ns) == 5
    assert fields_before(ring.reader(back=8), ring.newest, begin_at(12 - 20), trigger_ns) == 10
    assert fields_before(ring.reader(), ring.newest, begin_at(12), trigger_ns) == 0
    assert fields_before(reader, ring.newest, Begin(None, PERIOD_NS), 0) == 5


def test_a_ring_that_has_had_no_field_has_no_pre_trigger_either() -> None:
    ring = Ring(8)
    assert Begin.of(ring.reader(back=5), 12 * PERIOD_NS, 5, PERIOD_NS) == begin_at(12)
    ring.put(slot(10))
    assert Begin.of(ring.reader(back=5), 12 * PERIOD_NS, 5, PERIOD_NS) == replace(begin_at(9.5), n=10)
    assert Begin.of(ring.reader(back=5), None, 5, PERIOD_NS).time_ns is None


def test_numbers_are_not_off_by_what_the_ring_has_never_had_of_a_pre_trigger() -> None:
    ring = Ring(8)
    for n in range(40, 44):
        ring.put(uncertain(n))
    reader = ring.reader(back=4)
    begin = Begin.of(reader, 44 * PERIOD_NS, 20, PERIOD_NS)
    assert reader.oldest is not None
    first_n, numbers = begin.first_n(reader.oldest), NumbersFromBegin(begin)
    assert first_n == 40
    for n in range(4):
        assert numbers.events(uncertain(n)._replace(time_ns=(first_n + n) * PERIOD_NS)) == ()
    assert numbers.events(slot(4)._replace(time_ns=(first_n + 4) * PERIOD_NS)) == ()


def test_entries_are_cut_at_both_edges() -> None:
    lost = LedgerEntry(10, 10, Outcome.LOST, "time gap")
    assert cut([lost], 15) == (lost._replace(first_n=15, count=5),)
    assert cut([lost], 0, 12) == (lost._replace(count=2),)
    assert cut([lost], 20) == cut([lost], 0, 10) == ()


def uncertain(n: int) -> Slot:
    return slot(n)._replace(outcome=Outcome.DAMAGED, reason="number uncertain by up to 9")


def off(n: int, too_high_by: int) -> tuple[LedgerEvent, ...]:
    return (numbers_off(n, too_high_by),)


def test_what_the_stream_tells_of_its_numbers_is_told_of_a_capture_that_began_before() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    assert numbers.events(slot(0)) == ()
    assert numbers.events(uncertain(1)) == ()
    assert numbers.events(slot(2)._replace(rebases=off(2, 3))) == off(2, 3)


def test_a_capture_that_begins_in_a_doubt_compares_its_numbers_with_the_time() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    assert numbers.events(uncertain(0)) == ()
    late = slot(7)._replace(time_ns=5 * PERIOD_NS)
    assert numbers.events(late._replace(rebases=off(7, 40))) == off(7, 2)


def test_what_turns_out_within_a_doubt_is_told_at_once_and_the_rest_with_the_next_certain_field() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    assert numbers.events(uncertain(0)) == ()
    assert numbers.events(uncertain(1)._replace(rebases=off(1, 1))) == off(1, 1)
    late = slot(7)._replace(time_ns=5 * PERIOD_NS)
    assert numbers.events(late._replace(rebases=off(7, 40))) == off(7, 1)


def test_a_gap_of_unsure_length_at_the_end_of_a_doubt_is_told() -> None:
    numbers, unsure = NumbersFromBegin(begin_at(0.0)), (numbers_unsure(7, 1),)
    assert numbers.events(uncertain(0)) == ()
    assert numbers.events(slot(7)._replace(rebases=unsure)) == unsure


def test_a_capture_whose_numbers_turn_out_to_be_right_is_told_nothing() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    numbers.events(uncertain(0))
    assert numbers.events(slot(1)._replace(rebases=off(1, 40))) == ()


def test_what_an_overrun_has_taken_with_it_is_told_with_the_next_certain_field() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    numbers.events(slot(0))
    numbers.events(uncertain(1)._replace(rebases=off(1, 1)))
    overrun = (LedgerEntry(2, 5, Outcome.OVERRUN, "ring overrun"),)
    assert numbers.events(uncertain(7)._replace(lost_before=overrun)) == ()
    assert numbers.events(slot(10)._replace(time_ns=6 * PERIOD_NS)) == off(10, 3)


def test_in_a_doubt_of_many_fields_the_rate_of_the_camera_counts_and_not_the_granted_one() -> None:
    numbers = NumbersFromBegin(begin_at(0.0))
    slow_ns = PERIOD_NS * 201 // 200
    doubtful = [uncertain(n)._replace(time_ns=n * slow_ns) for n in range(500)]
    assert [numbers.events(one) for one in doubtful] == [()] * 500
    assert numbers.events(slot(500)._replace(time_ns=500 * slow_ns)) == ()
