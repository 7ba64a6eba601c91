"""The due end of a capture of given length of which nothing comes any more."""

from recorders import recorded, recorder
from slots import PERIOD_NS, ManualClock, slot

from grabberd.core.ledger import LedgerEntry, Outcome
from grabberd.instrument.acquisition import Ring
from grabberd.instrument.capture.recorder import GRACE_NS, HEARINGS, Begin


def test_what_a_stopped_program_has_kept_is_taken_though_the_capture_is_due_to_end() -> None:
    """The recorder may run first after a stop: its wait has timed out, and the ring has nothing new yet."""
    clock, ring = ManualClock(), Ring(64)
    one, backlog = recorder(100, clock=clock, reader=ring.reader(), begin=Begin(0, PERIOD_NS))
    for n in range(50):
        one.take(slot(n))
    clock.advance(100 * PERIOD_NS / 1e9 + GRACE_NS / 1e9 + 1.0)
    one._take_one()
    assert one.recording
    for n in range(50, 58):
        ring.put(slot(n))
    ring.put(slot(252, lost_before=194, reason="program stopped (for 4.0 s)"))
    while one.recording:
        one._take_one()
    assert one.ledger.entries == [LedgerEntry(58, 42, Outcome.LOST, "program stopped (for 4.0 s)")]
    assert len(recorded(backlog)) == 58


def test_a_capture_of_which_nothing_more_comes_ends_all_the_same() -> None:
    clock = ManualClock()
    one, _ = recorder(100, clock=clock, reader=Ring(64).reader(), begin=Begin(0, PERIOD_NS))
    for n in range(50):
        one.take(slot(n))
    clock.advance(100 * PERIOD_NS / 1e9 + GRACE_NS / 1e9 + 1.0)
    for _ in range(HEARINGS + 1):
        one._take_one()
    assert not one.recording
    assert one.ledger.entries == [LedgerEntry(50, 50, Outcome.LOST, "nothing came")]
