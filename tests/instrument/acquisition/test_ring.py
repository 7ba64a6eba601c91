"""The ring between the capture thread and its readers."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.ledger import LedgerEntry, LedgerEvent, Outcome, Rebase, Slot
from grabberd.errors import RingOverrun
from grabberd.instrument.acquisition.ring import Policy, Ring


def slot(n, lost=0):
    before = (LedgerEntry(n - lost, lost, Outcome.LOST, "time gap"),) if lost else ()
    return Slot(None, n, Outcome.RECEIVED, None, before, n * 20_000_000)


def fill(ring, *numbers):
    for n in numbers:
        ring.put(slot(n))


def drain(reader):
    slots = []
    while (taken := reader.take(0)) is not None:
        slots.append(taken)
    return slots


def test_a_reader_gets_what_comes_after_it():
    ring = Ring(4)
    fill(ring, 0, 1)
    reader = ring.reader()
    fill(ring, 2, 3)
    assert [taken.n for taken in drain(reader)] == [2, 3]


def test_readers_have_places_of_their_own():
    ring = Ring(4)
    one, other = ring.reader(), ring.reader()
    fill(ring, 0, 1)
    assert [taken.n for taken in drain(one)] == [0, 1]
    fill(ring, 2)
    assert [taken.n for taken in drain(other)] == [0, 1, 2]


def test_nothing_comes_from_an_empty_ring():
    reader = Ring().reader()
    assert reader.take(0) is None
    assert not reader.ended


def test_the_default_ring_has_thirty_two_slots():
    ring = Ring()
    reader = ring.reader()
    fill(ring, *range(32))
    assert len(drain(reader)) == 32


def test_a_ring_without_slots_is_refused():
    with pytest.raises(ValueError, match="at least one slot"):
        Ring(0)


def test_the_newest_slot_can_be_looked_at():
    ring = Ring(2)
    assert ring.newest is None
    fill(ring, 0, 1, 2)
    assert ring.newest.n == 2


# --- overrun ---


def test_an_overtaken_reader_is_told_what_it_missed():
    ring = Ring(4)
    reader = ring.reader(Policy.COUNT)
    fill(ring, 0)
    reader.take(0)
    fill(ring, *range(1, 8))
    taken = reader.take(0)
    assert taken.n == 4
    assert taken.lost_before == (LedgerEntry(1, 3, Outcome.OVERRUN, "ring overrun"),)
    assert [later.n for later in drain(reader)] == [5, 6, 7]


def test_losses_before_the_first_slot_that_is_left_keep_their_own_reason():
    ring = Ring(2)
    reader = ring.reader()
    fill(ring, 0, 1)
    ring.put(slot(5, lost=3))
    fill(ring, 6)
    overrun, gap = reader.take(0).lost_before
    assert overrun == LedgerEntry(0, 2, Outcome.OVERRUN, "ring overrun")
    assert gap == LedgerEntry(2, 3, Outcome.LOST, "time gap")


def test_losses_among_overwritten_slots_keep_their_own_reason():
    ring = Ring(2)
    reader = ring.reader()
    fill(ring, 0)
    ring.put(slot(5, lost=4)._replace(lost_before=(LedgerEntry(1, 4, Outcome.LOST, "unplugged"),)))
    fill(ring, 6, 7, 8)
    assert reader.take(0).lost_before == (
        LedgerEntry(0, 1, Outcome.OVERRUN, "ring overrun"),
        LedgerEntry(1, 4, Outcome.LOST, "unplugged"),
        LedgerEntry(5, 2, Outcome.OVERRUN, "ring overrun"),
    )


def test_losses_right_before_and_right_after_one_another_leave_no_empty_overrun():
    ring = Ring(1)
    reader = ring.reader()
    ring.put(slot(3, lost=3))
    fill(ring, 4)
    assert reader.take(0).lost_before == (
        LedgerEntry(0, 3, Outcome.LOST, "time gap"),
        LedgerEntry(3, 1, Outcome.OVERRUN, "ring overrun"),
    )


def test_changes_of_the_clock_among_overwritten_slots_are_told():
    ring = Ring(2)
    reader = ring.reader()
    event = LedgerEvent(1, Rebase.CLOCK, "the clock of the timestamps was set by +3.000 s")
    fill(ring, 0)
    ring.put(slot(1)._replace(rebases=(event,)))
    fill(ring, 2, 3, 4)
    first, second = drain(reader)
    assert first.rebases == (event,)
    assert second.rebases == ()


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=60), st.integers(1, 5))
def test_every_field_is_accounted_for_once_however_late_the_reader_comes(puts, slots):
    ring = Ring(slots)
    reader = ring.reader()
    n, accounted = 0, []
    for lost, then_read in puts:
        n += lost
        ring.put(slot(n, lost))
        n += 1
        accounted += drain(reader) if then_read else []
    accounted += drain(reader)
    ranges = [(e.first_n, e.end_n) for taken in accounted for e in (*taken.lost_before, slot_as_entry(taken))]
    assert [begin for begin, _ in ranges] == [0, *(end for _, end in ranges[:-1])][: len(ranges)]
    lost_fields = sum(e.count for taken in accounted for e in taken.lost_before if e.outcome is Outcome.LOST)
    assert lost_fields == sum(lost for lost, _ in puts)


def slot_as_entry(taken):
    return LedgerEntry(taken.n, 1, taken.outcome, "")


def test_a_reader_that_may_miss_nothing_is_stopped_for_good():
    ring = Ring(4)
    reader = ring.reader(Policy.STOP)
    fill(ring, *range(6))
    for _ in range(2):
        with pytest.raises(RingOverrun, match="2 fields from number 0") as caught:
            reader.take(0)
    assert (caught.value.first_n, caught.value.count) == (0, 2)


def test_another_readers_overrun_is_nobody_elses():
    ring = Ring(2)
    slow, quick = ring.reader(Policy.STOP), ring.reader(Policy.STOP)
    for n in range(5):
        fill(ring, n)
        assert quick.take(0).n == n
    with pytest.raises(RingOverrun):
        slow.take(0)


def test_the_deepest_fill_is_kept_for_each_reader():
    ring = Ring(4)
    reader = ring.reader()
    fill(ring, 0, 1, 2)
    drain(reader)
    fill(ring, 3)
    drain(reader)
    assert reader.deepest == 3
    fill(ring, *range(4, 20))
    drain(reader)
    assert reader.deepest == 4


def test_what_is_waiting_can_be_asked():
    ring = Ring(4)
    fill(ring, 0)
    reader = ring.reader(back=1)
    fill(ring, 1, 2)
    assert reader.waiting == 3
    reader.take(0)
    assert reader.waiting == 2


# --- pre-trigger ---


def test_slots_before_the_trigger_belong_to_the_reader():
    ring = Ring(4)
    fill(ring, *range(10))
    reader = ring.reader(back=3)
    fill(ring, 10)
    assert [taken.n for taken in drain(reader)] == [7, 8, 9, 10]


def test_the_oldest_slot_before_the_trigger_is_known_with_what_was_lost_before_it():
    ring = Ring(4)
    assert ring.reader(back=3).oldest is None
    ring.put(slot(0))
    ring.put(slot(3, lost=2))
    assert [ring.reader(back=back).oldest for back in (0, 1, 9)] == [None, slot(3, lost=2), slot(0)]


def test_slots_before_the_trigger_cannot_be_overrun():
    ring = Ring(4)
    fill(ring, *range(4))
    reader = ring.reader(Policy.STOP, back=4)
    fill(ring, 4, 5, 6)
    assert [taken.n for taken in drain(reader)] == [0, 1, 2, 3, 4, 5, 6]


def test_no_more_slots_than_there_are_come_from_before_the_trigger():
    ring = Ring(8)
    fill(ring, 0, 1)
    assert [taken.n for taken in drain(ring.reader(back=99))] == [0, 1]


def test_what_is_lost_right_after_the_trigger_belongs_to_the_capture():
    ring = Ring(8)
    fill(ring, 0)
    reader = ring.reader()
    ring.put(slot(4, lost=3))
    assert reader.take(0).lost_before == slot(4, lost=3).lost_before


# --- the end ---


def test_a_closed_ring_gives_what_is_left_and_then_nothing():
    ring = Ring(4)
    reader = ring.reader()
    fill(ring, 0, 1)
    ring.close()
    assert not reader.ended
    assert len(drain(reader)) == 2
    assert reader.ended
    assert reader.take(10) is None


def test_closing_wakes_a_reader_that_waits():
    ring = Ring()
    reader, taken = ring.reader(), []
    thread = threading.Thread(target=lambda: taken.append(reader.take(60)))
    thread.start()
    ring.close()
    thread.join(10)
    assert taken == [None]


def test_a_reader_that_lets_go_gets_nothing_more():
    ring = Ring()
    with ring.reader() as reader:
        fill(ring, 0)
    assert reader.ended
    assert reader.take(10) is None


def test_a_waiting_reader_is_woken_by_the_next_slot():
    ring = Ring()
    reader, taken = ring.reader(), []
    thread = threading.Thread(target=lambda: taken.append(reader.take(60)))
    thread.start()
    fill(ring, 17)
    thread.join(10)
    assert [slot.n for slot in taken] == [17]


def test_a_writer_and_readers_in_threads_lose_count_of_nothing():
    ring, total = Ring(8), 5_000
    readers = [ring.reader() for _ in range(3)]
    seen = [[] for _ in readers]

    def read(reader, numbers):
        while not reader.ended:
            if taken := reader.take(1):
                numbers.extend(n for entry in taken.lost_before for n in range(entry.first_n, entry.end_n))
                numbers.append(taken.n)

    threads = [threading.Thread(target=read, args=pair) for pair in zip(readers, seen, strict=True)]
    for thread in threads:
        thread.start()
    fill(ring, *range(total))
    ring.close()
    for thread in threads:
        thread.join(30)
    assert seen == [list(range(total))] * 3


@given(st.integers(1, 6), st.lists(st.one_of(st.integers(0, 3), st.none()), max_size=60), st.integers(0, 9))
def test_every_number_is_accounted_for_whatever_the_reader_does(slots, steps, before):
    """A step is a slot put after so many lost fields, or (None) a slot taken."""
    ring, n = Ring(slots), 0
    fill(ring, *range(before))
    n = before
    reader, numbers = ring.reader(), []

    def note(taken):
        numbers.extend(i for entry in taken.lost_before for i in range(entry.first_n, entry.end_n))
        numbers.append(taken.n)

    for lost in steps:
        if lost is None:
            if (taken := reader.take(0)) is not None:
                note(taken)
        else:
            n += lost
            ring.put(slot(n, lost))
            n += 1
    for taken in drain(reader):
        note(taken)
    assert numbers == list(range(before, n))


def test_a_ring_tells_how_far_its_slowest_reader_is_behind_and_ever_was() -> None:
    ring = Ring(4)
    slow, quick = ring.reader(), ring.reader()
    for n in range(3):
        ring.put(slot(n))
        quick.take(0)
    assert (ring.waiting, ring.deepest) == (3, 1)
    slow.take(0)
    assert (ring.waiting, ring.deepest) == (2, 3)
    slow.close()
    assert (ring.waiting, ring.deepest) == (0, 3)


def test_a_ring_has_32_slots_as_in_the_paper_and_begins_empty() -> None:
    ring = Ring()
    assert (ring.slots, ring.waiting, ring.deepest, ring.newest) == (32, 0, 0, None)


def test_a_reader_that_was_overtaken_has_a_whole_ring_before_it() -> None:
    ring = Ring(4)
    reader = ring.reader()
    for n in range(10):
        ring.put(slot(n))
    assert ring.waiting == 4
    reader.take(0)
    assert (ring.waiting, ring.deepest) == (3, 4)


def test_closing_a_reader_wakes_the_thread_that_waits_in_it():
    class NotedCondition(threading.Condition):
        """A condition that tells when somebody waits on it."""

        def wait(self, timeout=None):
            waited_for.set()
            return super().wait(timeout)

    waited_for, taken, ring = threading.Event(), [], Ring()
    ring._changed = NotedCondition(threading.Lock())
    reader = ring.reader()
    thread = threading.Thread(target=lambda: taken.append(reader.take(600.0)), daemon=True)
    thread.start()
    assert waited_for.wait(30.0)
    reader.close()
    thread.join(30.0)
    assert taken == [None]
