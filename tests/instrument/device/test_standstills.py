"""What people are told of standstills."""

import pytest
from scripted import S
from slots import ManualClock, slot

from grabberd.core.ledger import LedgerEvent, LossCause, Rebase
from grabberd.errors import Cause
from grabberd.instrument.acquisition import Standstill
from grabberd.instrument.device.scheduling import SHOWN_S
from grabberd.instrument.device.status_board import StatusBoard

SECOND_NS = 1_000_000_000


def waited(seconds: float) -> Standstill:
    return Standstill(round(seconds * 1e9), round(seconds * 1e9), 0)


def stopped(seconds: float) -> Standstill:
    return Standstill(round(seconds * 1e9), 0, 0)


def test_a_standstill_is_shown_for_a_minute_with_what_to_do() -> None:
    clock = ManualClock(100 * SECOND_NS)
    board = StatusBoard("cup", clock)
    assert board.standstills.shown is None
    board.stood_still(waited(1.2))
    shown = board.standstills.shown
    assert shown
    assert (shown.cause, shown.code) == ("computer busy (waited 1.2 s for a processor)", Cause.COMPUTER_BUSY)
    assert shown.hint
    clock.advance(SHOWN_S + 1)
    assert board.standstills.shown is None


def test_one_that_goes_on_is_one_and_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    clock = ManualClock(100 * SECOND_NS)
    board = StatusBoard("cup", clock)
    for seconds in (1.0, 1.1, 1.2):
        board.stood_still(waited(seconds))
        clock.advance(0.1)
    assert board.standstills.counts == {Cause.COMPUTER_BUSY: 1}
    assert board.standstills.seconds[Cause.COMPUTER_BUSY] == pytest.approx(1.2)
    clock.advance(20.0)
    board.stood_still(stopped(12.0))
    assert board.standstills.counts == {Cause.COMPUTER_BUSY: 1, Cause.PROGRAM_STOPPED: 1}
    assert [record.message.partition(";")[0] for record in caplog.records] == [
        "device cup: computer busy (waited 1.0 s for a processor)",
        "device cup: program stopped (for 12.0 s)",
    ]


def test_a_computer_that_stays_busy_is_logged_again_only_after_a_quiet_minute(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock = ManualClock(100 * SECOND_NS)
    board = StatusBoard("cup", clock)
    for _ in range(50):
        clock.advance(2.0)
        board.stood_still(waited(0.3))
    assert board.standstills.counts == {Cause.COMPUTER_BUSY: 50}
    assert len(caplog.records) == 1
    clock.advance(SHOWN_S + 1)
    board.stood_still(waited(0.3))
    assert len(caplog.records) == 2


def test_losses_are_counted_by_their_cause() -> None:
    board = StatusBoard("cup", ManualClock())
    board.enter(S.OPENING)
    board.count(slot(9, lost_before=4, reason="computer busy (waited 1.2 s for a processor)"))
    board.count(slot(12, lost_before=2, reason="sequence gap"))
    assert board.now.losses == {LossCause.COMPUTER: 4, LossCause.CABLE: 2}


def test_a_rebase_is_counted_and_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    board = StatusBoard("cup", ManualClock())
    event = LedgerEvent(7, Rebase.CLOCK, "the clock of the timestamps was set by +1.000 s")
    board.count(slot(7)._replace(rebases=(event,)))
    board.count(slot(8))
    assert board.now.rebases == {Rebase.CLOCK: 1}
    assert [record.message for record in caplog.records] == [f"device cup: {event.reason}, from field 7 on"]
