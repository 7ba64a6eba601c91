"""What is known of a device from moment to moment."""

import pytest
from slots import ManualClock, slot, without_signal

from grabberd.service.device.status_board import StatusBoard


def board_after(fields: int, period_s: float = 0.02) -> tuple[StatusBoard, ManualClock]:
    clock = ManualClock()
    board = StatusBoard("test", clock)
    for n in range(fields):
        clock.advance(period_s)
        board.count(slot(n))
    return board, clock


def test_the_rate_is_that_of_the_fields_that_come() -> None:
    board, _ = board_after(50)
    assert board.rate_hz == pytest.approx(50.0)
    slow, _ = board_after(50, period_s=0.04)
    assert slow.rate_hz == pytest.approx(25.0)


def test_there_is_no_rate_before_two_fields_have_come() -> None:
    assert board_after(0)[0].rate_hz is None
    assert board_after(1)[0].rate_hz is None


def test_there_is_no_rate_once_nothing_comes() -> None:
    board, clock = board_after(50)
    clock.advance(1.5)
    assert board.rate_hz is None


def test_what_has_no_picture_does_not_count() -> None:
    board, clock = board_after(1)
    for n in range(1, 20):
        clock.advance(0.02)
        board.count(without_signal(n))
    assert board.rate_hz is None
