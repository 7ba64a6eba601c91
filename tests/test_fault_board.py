"""Faults of the daemon itself: each is told once, for as long as it lasts."""

import logging

import pytest
from slots import ManualClock

from grabberd.errors import Cause
from grabberd.fault_board import FaultBoard


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(0)


@pytest.fixture
def board(clock: ManualClock) -> FaultBoard:
    return FaultBoard(clock)


def test_it_is_logged_when_it_begins_and_when_it_is_over(
    board: FaultBoard, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    for attempt in range(1000):
        board.report(Cause.CAPTURE_UNSEALED, f"{attempt} attempts have failed", "wait")
    board.resolve(Cause.CAPTURE_UNSEALED)
    board.resolve(Cause.CAPTURE_UNSEALED)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [
        ("ERROR", "0 attempts have failed; wait"),
        ("INFO", "over since now: 999 attempts have failed"),
    ]
    assert board.counts == {Cause.CAPTURE_UNSEALED: 1}


def test_it_has_its_newest_message_and_its_first_moment(board: FaultBoard, clock: ManualClock) -> None:
    board.report(Cause.CAPTURES_MISSING, "gone", "mount it")
    clock.advance(60)
    board.report(Cause.CAPTURES_MISSING, "still gone", "mount it")
    (fault,) = board.now
    assert (fault.message, fault.since_utc) == ("still gone", "2026-01-01T00:00:00.000Z")


def test_what_a_person_has_to_act_on_comes_first(board: FaultBoard, clock: ManualClock) -> None:
    board.report(Cause.INDEX_REBUILDING, "being rebuilt", "wait", "warning")
    clock.advance(1)
    board.report(Cause.SETTINGS_LOST, "lost", "restore them")
    clock.advance(1)
    board.report(Cause.CAPTURES_MISSING, "gone", "mount it")
    order = [Cause.SETTINGS_LOST, Cause.CAPTURES_MISSING, Cause.INDEX_REBUILDING]
    assert [fault.cause_code for fault in board.now] == order
