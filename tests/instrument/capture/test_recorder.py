"""The recorder: which fields belong to a capture, and what its ledger says."""

from dataclasses import replace

import pytest
from recorders import recorded, recorder
from slots import PERIOD_NS, STREAM, ManualClock, damaged, slot, without_signal

from grabberd.core.ledger import LedgerEntry, Outcome, Slot
from grabberd.instrument.acquisition import Ring, RingReader
from grabberd.instrument.capture.recorder import GRACE_NS, Begin


def test_fields_are_numbered_from_the_captures_first() -> None:
    one, backlog = recorder(3)
    for n in (1000, 1001, 1002):
        one.take(slot(n))
    assert recorded(backlog) == [0, 1, 2]
    assert [entry.numbered.n for entry in backlog.from_index(0, 0) if entry.numbered] == [0, 1, 2]
    assert one.first_n == 1000


def test_it_ends_with_the_last_field_of_its_length() -> None:
    one, _ = recorder(2)
    one.take(slot(7))
    assert one.recording
    one.take(slot(8))
    assert not one.recording
    assert one.ended_because == "length reached"
    assert one.ledger.complete


def test_what_was_lost_before_the_first_field_is_not_the_captures() -> None:
    one, _ = recorder(1)
    one.take(slot(10, lost_before=5))
    assert one.ledger.complete


def since(clock: ManualClock) -> Begin:
    """The begin of a capture that is asked for now."""
    return Begin(clock.ns, PERIOD_NS)


def test_no_field_is_older_than_the_request() -> None:
    clock = ManualClock(10 * PERIOD_NS)
    one, backlog = recorder(3, begin=since(clock))
    for n in range(7, 13):
        one.take(slot(n))
    assert (one.first_n, recorded(backlog)) == (10, [0, 1, 2])
    assert one.ledger.complete


def test_what_is_lost_between_the_request_and_the_first_field_is_the_captures() -> None:
    clock = ManualClock(10 * PERIOD_NS)
    one, backlog = recorder(50, begin=since(clock))
    one.take(slot(40, lost_before=35, reason="no field for 0.8 s"))
    assert one.ledger.entries == [LedgerEntry(0, 30, Outcome.LOST, "no field for 0.8 s")]
    assert recorded(backlog) == [30]


def test_where_nothing_came_but_what_is_older_the_account_goes_from_the_request_to_the_stop() -> None:
    clock, ring = ManualClock(10 * PERIOD_NS), Ring()
    reader = ring.reader()
    one, _ = recorder(clock=clock, reader=reader, begin=since(clock))
    heard(clock, reader, {})
    clock.ns = 40 * PERIOD_NS
    one.take(slot(8))  # has waited for as long
    clock.ns = 60 * PERIOD_NS
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(0, 50, Outcome.LOST, "nothing came")]


def test_a_stop_takes_what_was_exposed_before_it_and_nothing_later() -> None:
    clock, ring = ManualClock(0), Ring()
    reader = ring.reader()
    one, backlog = recorder(clock=clock, reader=reader, begin=since(clock))
    heard(clock, reader, {})
    for n in range(5):
        ring.put(slot(n))
    clock.ns = 8 * PERIOD_NS - 1
    for n in (5, 6, 7, 8, 9):
        ring.put(slot(n))
    one.stop("stopped by the operator")
    one.run()
    assert recorded(backlog) == list(range(8))
    assert one.ledger.complete


def test_what_is_lost_up_to_the_stop_is_the_captures_and_not_what_is_lost_after_it() -> None:
    clock, ring = ManualClock(0), Ring()
    reader = ring.reader()
    one, _ = recorder(clock=clock, reader=reader, begin=since(clock))
    heard(clock, reader, {})
    one.take(slot(0))
    clock.ns = 5 * PERIOD_NS
    ring.put(slot(9, lost_before=8))
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 4, Outcome.LOST, "time gap")]


def test_fields_that_a_slow_disk_refused_at_the_end_are_in_the_account() -> None:
    one, _ = recorder(capacity=1)
    one.take(slot(0))
    one.take(slot(1))
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 1, Outcome.OVERRUN, "disk too slow")]


def test_lost_fields_count_for_the_length() -> None:
    one, backlog = recorder(5)
    one.take(slot(0))
    one.take(slot(4, lost_before=3))
    assert not one.recording
    assert recorded(backlog) == [0, 4]
    assert one.ledger.entries == [LedgerEntry(1, 3, Outcome.LOST, "time gap")]


def test_a_gap_beyond_its_length_is_cut_there() -> None:
    one, backlog = recorder(5)
    one.take(slot(0))
    one.take(slot(9, lost_before=8, reason="unplugged"))
    assert recorded(backlog) == [0]
    assert one.ledger.entries == [LedgerEntry(1, 4, Outcome.LOST, "unplugged")]
    assert one.ledger.total == 5


def test_damaged_fields_and_those_without_signal_are_in_the_ledger() -> None:
    one, _ = recorder()
    for entry in (slot(0), damaged(1), without_signal(2), slot(3)):
        one.take(entry)
    assert one.ledger.counts() == {
        Outcome.RECEIVED: 2,
        Outcome.LOST: 0,
        Outcome.DAMAGED: 1,
        Outcome.NO_SIGNAL: 1,
        Outcome.OVERRUN: 0,
    }


def test_fields_that_a_slow_disk_leaves_no_room_for_are_overrun_and_it_goes_on() -> None:
    one, backlog = recorder(capacity=2)
    for n in range(4):
        one.take(slot(n))
    backlog.written(2)
    one.take(slot(4))
    assert recorded(backlog) == [0, 1, 4]
    assert one.ledger.entries == [LedgerEntry(2, 2, Outcome.OVERRUN, "disk too slow")]


def test_it_drains_a_ring_until_its_length() -> None:
    ring = Ring()
    reader = ring.reader()
    one, backlog = recorder(4, reader=reader)
    for n in range(6):
        ring.put(slot(n))
    one.run()
    assert recorded(backlog) == [0, 1, 2, 3]
    assert backlog.closed
    assert one.ledger.complete


def test_with_the_policy_stop_an_overrun_ends_it_and_the_ledger_says_so() -> None:
    ring = Ring(4)
    reader = ring.reader("stop")
    one, backlog = recorder(reader=reader)
    ring.put(slot(0))
    taken = reader.take(0)
    assert taken
    one.take(taken)
    for n in range(1, 8):
        ring.put(slot(n))
    one.run()
    assert recorded(backlog) == [0]
    assert one.ledger.entries == [LedgerEntry(1, 3, Outcome.OVERRUN, "ring overrun")]
    assert "overwritten in the ring" in (one.ended_because or "")


def test_with_the_policy_count_it_goes_on_after_an_overrun() -> None:
    ring = Ring(4)
    reader = ring.reader("count")
    one, backlog = recorder(4, reader=reader)
    for n in range(8):
        ring.put(slot(n))
    one.run()
    assert recorded(backlog) == [0, 1, 2, 3]
    assert one.first_n == 4


def test_the_slots_before_the_trigger_belong_to_it() -> None:
    ring = Ring()
    for n in range(10):
        ring.put(slot(n))
    reader = ring.reader(back=3)
    one, backlog = recorder(5, reader=reader)
    for n in range(10, 14):
        ring.put(slot(n))
    one.run()
    assert one.first_n == 7
    assert recorded(backlog) == [0, 1, 2, 3, 4]


def test_a_stop_keeps_what_is_in_the_ring_already() -> None:
    ring = Ring()
    reader = ring.reader()
    one, backlog = recorder(reader=reader)
    for n in range(3):
        ring.put(slot(n))
    one.stop("stopped by the operator")
    one.run()
    assert recorded(backlog) == [0, 1, 2]
    assert one.ended_because == "stopped by the operator"


def test_the_first_reason_to_end_stays() -> None:
    one, _ = recorder()
    one.stop("stopped by the operator")
    one.stop("the daemon stopped")
    assert one.ended_because == "stopped by the operator"


def test_a_capture_of_given_length_ends_although_nothing_comes_any_more() -> None:
    clock = ManualClock()
    ring = Ring()
    reader = ring.reader()
    one, _ = recorder(10, clock=clock, reader=reader)
    ring.put(slot(0))
    clock.ns += 10 * PERIOD_NS + GRACE_NS + 1
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 9, Outcome.LOST, "nothing came")]


def test_a_source_that_waits_for_its_reader_is_given_its_time() -> None:
    clock = ManualClock()
    one, _ = recorder(10, clock=clock, stream=replace(STREAM, waits_for_reader=True))
    clock.advance(1000)
    one.take(slot(0))
    assert one.recording


@pytest.mark.parametrize("lossless", [True, False])
def test_a_capture_of_given_length_ends_in_its_time_although_the_device_never_returns(lossless: bool) -> None:
    clock, ring = ManualClock(), Ring()
    reader = ring.reader()
    one, backlog = recorder(
        100,
        clock=clock,
        stream=replace(STREAM, waits_for_reader=lossless),
        interruption=lambda: "unplugged",
        reader=reader,
    )
    for n in range(10):
        ring.put(slot(n))
    begun_ns = clock.ns
    timed_take = reader.take

    def take(timeout_s: float) -> Slot | None:
        taken = timed_take(0)
        clock.advance(0.02 if taken else timeout_s)
        return taken

    reader.take = take  # type: ignore[method-assign]
    one.run()
    assert one.ended_because == "length reached"
    assert one.ledger.entries == [LedgerEntry(10, 90, Outcome.LOST, "unplugged")]
    assert recorded(backlog) == list(range(10))
    assert (clock.ns - begun_ns) / 1e9 == pytest.approx(100 * 0.02 + GRACE_NS / 1e9, abs=0.2)


def test_what_a_device_that_is_away_at_the_stop_should_have_delivered_is_lost() -> None:
    clock, ring = ManualClock(), Ring()
    reader = ring.reader()
    one, _ = recorder(clock=clock, interruption=lambda: "unplugged", reader=reader)
    one.take(slot(0))
    clock.advance(50 * 0.02)
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 50, Outcome.LOST, "unplugged")]
    assert not one.ledger.complete


def test_a_source_that_waits_for_its_reader_has_lost_nothing_while_it_was_interrupted() -> None:
    clock = ManualClock()
    stream = replace(STREAM, waits_for_reader=True)
    one, _ = recorder(clock=clock, stream=stream, interruption=lambda: "paused")
    one.take(slot(0))
    one.take(slot(1))
    clock.advance(1.0)
    one.stop("stopped by the operator")
    one.run()
    assert (one.ledger.end_n, one.ledger.complete) == (2, True)


def test_a_stop_while_fields_come_loses_nothing() -> None:
    clock, ring = ManualClock(), Ring()
    reader = ring.reader()
    one, _ = recorder(clock=clock, reader=reader)
    one.take(slot(0))
    clock.advance(0.03)
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.complete


def heard(clock: ManualClock, reader: RingReader, comes: dict[int, Slot]) -> None:
    """Makes time pass for who takes from a reader; slots come at their time in ms."""
    take = reader.take

    def timed(timeout_s: float) -> Slot | None:
        if (taken := take(0)) is not None:
            return taken
        clock.advance(timeout_s)
        passed_ms = (clock.ns - ManualClock().ns) // 1_000_000
        due = [at for at in comes if at <= passed_ms]
        return comes.pop(due[0]) if due and timeout_s else None

    reader.take = timed  # type: ignore[method-assign]


def test_a_stall_that_nobody_has_noticed_when_it_is_stopped_is_noticed_then() -> None:
    clock, ring = ManualClock(), Ring()
    begun_ns = clock.ns
    reader = ring.reader()
    one, _ = recorder(
        clock=clock,
        interruption=lambda: "no field for 0.8 s" if clock.ns - begun_ns > 8e8 else None,
        reader=reader,
    )
    heard(clock, reader, {})
    one.take(slot(0))
    clock.advance(0.5)
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 25, Outcome.LOST, "no field for 0.8 s")]
    assert clock.ns - begun_ns < 1.0e9


def test_a_silence_at_the_stop_that_nobody_explains_is_a_loss_all_the_same() -> None:
    clock, ring = ManualClock(), Ring()
    reader = ring.reader()
    one, _ = recorder(clock=clock, reader=reader)
    heard(clock, reader, {})
    one.take(slot(0))
    clock.advance(0.5)
    one.stop("stopped by the operator")
    one.run()
    assert one.ledger.entries == [LedgerEntry(1, 25, Outcome.LOST, "nothing came")]


def test_the_field_that_ends_a_silence_at_the_stop_says_what_was_lost() -> None:
    clock, ring = ManualClock(), Ring()
    reader = ring.reader()
    one, backlog = recorder(clock=clock, reader=reader)
    heard(clock, reader, {600: slot(30, lost_before=29)})
    one.take(slot(0))
    clock.advance(0.5)
    one.stop("stopped by the operator")
    one.run()
    assert recorded(backlog) == [0, 30]
    assert one.ledger.entries == [LedgerEntry(1, 29, Outcome.LOST, "time gap")]


def test_a_recording_may_pause_before_it_ends() -> None:
    clock = ManualClock()
    one, _ = recorder(clock=clock, stream=replace(STREAM, live=False))
    one.take(slot(0))
    clock.advance(5)
    one.stop("the recording has ended")
    one.run()
    assert one.ledger.complete
