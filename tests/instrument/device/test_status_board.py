"""What is known of a device from moment to moment."""

import logging
import threading
from dataclasses import replace

import pytest
from recording_rig import PATIENCE_S
from slots import STREAM, ManualClock, slot, without_signal

from grabberd.core.ledger import Outcome
from grabberd.documents.enums import DeviceState, Rung
from grabberd.errors import Cause, DeviceRefused, PictureError, StorageError, StreamFailed
from grabberd.instrument.device.recovery import Step
from grabberd.instrument.device.status_board import TRANSITIONS, StatusBoard, cause_of, may_follow
from grabberd.runtime import iso_utc


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


def test_the_rate_ends_a_second_after_the_last_field() -> None:
    board, clock = board_after(50)
    clock.advance(1.0)
    assert board.rate_hz == pytest.approx(50.0)
    clock.advance(0.001)
    assert board.rate_hz is None


def test_the_rate_is_that_of_the_last_two_seconds() -> None:
    board, clock = board_after(100, period_s=0.04)
    for n in range(100, 199):
        clock.advance(0.02)
        board.count(slot(n))
    assert board.rate_hz == pytest.approx(50.0)


@pytest.mark.parametrize("rate_hz", [25.0, 60.0, 120.0])
def test_two_seconds_are_as_many_fields_as_the_device_grants(rate_hz: float) -> None:
    board, clock = board_after(0)
    board.opened(replace(STREAM, rate_hz=rate_hz))
    for n in range(round(6 * rate_hz)):
        clock.advance((1.5 if n < 4 * rate_hz else 1.0) / rate_hz)
        board.count(slot(n))
    assert board.rate_hz == pytest.approx(rate_hz, rel=0.01)


def test_the_rate_does_not_span_a_new_opening() -> None:
    board, clock = board_after(50)
    board.opened(STREAM)
    assert board.rate_hz is None
    clock.advance(0.5)
    for n in range(50, 60):
        clock.advance(0.02)
        board.count(slot(n))
    assert board.rate_hz == pytest.approx(50.0)
    assert board.now.openings == 1


def test_fields_are_counted_with_the_ones_lost_before_them() -> None:
    board = StatusBoard("test", ManualClock())
    board.count(slot(0))
    board.count(slot(4, lost_before=3))
    board.count(without_signal(5))
    assert board.now.outcomes == {Outcome.RECEIVED: 2, Outcome.LOST: 3, Outcome.NO_SIGNAL: 1}


def test_a_status_that_was_asked_for_does_not_change_any_more() -> None:
    board = StatusBoard("test", ManualClock())
    before = board.now
    board.count(slot(0))
    board.recovers(Step(Rung.RESTART, 0.0, DeviceState.RECOVERING), StreamFailed("no field for 0.8 s", ""))
    assert (before.outcomes, before.recoveries) == ({}, {})
    assert board.now.recoveries == {Rung.RESTART: 1}


def test_the_silence_is_counted_from_the_last_beat() -> None:
    clock = ManualClock()
    board = StatusBoard("test", clock)
    clock.advance(3.0)
    assert board.silent_s == 3.0
    board.beat()
    clock.advance(0.5)
    assert board.silent_s == 0.5


def test_a_state_keeps_its_time_until_it_or_its_cause_changes() -> None:
    clock = ManualClock()
    board = StatusBoard("test", clock)
    board.enter(DeviceState.FAILED, "it is busy", "close the other program", Cause.DEVICE_REFUSED)
    since = iso_utc(clock.utc_now())
    clock.advance(5.0)
    board.enter(DeviceState.FAILED, "it is busy")
    now = board.now
    assert (now.since_utc, now.hint, now.code) == (since, "close the other program", Cause.DEVICE_REFUSED)
    board.enter(DeviceState.FAILED, "it is not permitted")
    assert board.now.since_utc == iso_utc(clock.utc_now()) != since


def test_a_state_that_may_not_follow_is_refused_and_changes_nothing() -> None:
    board = StatusBoard("test", ManualClock())
    with pytest.raises(ValueError, match="device test: ready may not follow absent"):
        board.enter(DeviceState.READY)
    assert board.state is DeviceState.ABSENT


def test_the_last_failure_has_the_time_at_which_it_first_came() -> None:
    clock = ManualClock()
    board = StatusBoard("test", clock)
    stalled = StreamFailed("no field for 0.8 s", "check the cable")
    restart = Step(Rung.RESTART, 0.0, DeviceState.RECOVERING)
    board.recovers(restart, stalled)
    first = iso_utc(clock.utc_now())
    clock.advance(5.0)
    board.recovers(restart, stalled)
    now = board.now
    assert (now.last_failure, now.last_failure_utc) == ("no field for 0.8 s", first)
    assert (now.cause, now.hint, now.code) == ("no field for 0.8 s", "check the cable", Cause.STREAM_FAILED)
    board.recovers(restart, StreamFailed("half a frame", ""))
    assert board.now.last_failure_utc == iso_utc(clock.utc_now()) != first


def test_a_device_that_is_retried_is_logged_once_per_cause(caplog: pytest.LogCaptureFixture) -> None:
    board = StatusBoard("test", ManualClock())
    with caplog.at_level(logging.INFO):
        for cause in ("it is busy", "it is busy", "it is not permitted"):
            board.enter(DeviceState.FAILED, cause, "ask someone")
            board.enter(DeviceState.OPENING)
        board.enter(DeviceState.READY)
    assert [(one.levelno, one.getMessage()) for one in caplog.records] == [
        (logging.WARNING, "device test is failed: it is busy; ask someone"),
        (logging.WARNING, "device test is failed: it is not permitted; ask someone"),
        (logging.INFO, "device test is ready"),
    ]


def test_a_refused_reset_is_a_warning_until_it_is_possible(caplog: pytest.LogCaptureFixture) -> None:
    board = StatusBoard("test", ManualClock())
    refusal = DeviceRefused("it cannot be reset", "install the udev rule")
    board.refused("reset", refusal)
    board.refused("reset", refusal)
    board.refused("real time", DeviceRefused("it is not first", "permit it"))
    assert board.now.warnings == ("it cannot be reset; install the udev rule", "it is not first; permit it")
    assert caplog.text.count("it cannot be reset") == 1
    board.refused("reset", None)
    assert board.now.warnings == ("it is not first; permit it",)


def test_only_errors_of_a_device_or_a_recording_have_a_cause_code() -> None:
    assert cause_of(StreamFailed("no field for 0.8 s", "")) is Cause.STREAM_FAILED
    assert cause_of(PictureError("it is truncated", "")) is Cause.RECORDING_DAMAGED
    assert cause_of(StorageError("the disk says no", "")) is None


def test_whoever_waits_for_a_state_is_woken_by_it() -> None:
    board = StatusBoard("test", ManualClock())
    waiting = threading.Event()

    def is_opening() -> bool:
        waiting.set()
        return board.state is DeviceState.OPENING

    def wait() -> None:
        with board.changed:
            board.changed.wait_for(is_opening)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    assert waiting.wait(PATIENCE_S)
    board.enter(DeviceState.OPENING)
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


def test_every_state_has_a_row_and_a_way_out() -> None:
    assert set(TRANSITIONS) == set(DeviceState)
    assert all(TRANSITIONS[state] for state in DeviceState)


@pytest.mark.parametrize("state", DeviceState)
def test_every_state_can_get_to_ready(state: DeviceState) -> None:
    reached, before = {state}, set()
    while reached != before:
        before = set(reached)
        reached |= {after for one in before for after in TRANSITIONS[one]}
    assert DeviceState.READY in reached


@pytest.mark.parametrize("state", DeviceState)
def test_staying_is_always_allowed(state: DeviceState) -> None:
    assert may_follow(state, state)


def test_a_device_is_not_ready_before_it_was_opened() -> None:
    assert not may_follow(DeviceState.ABSENT, DeviceState.READY)
    assert not may_follow(DeviceState.RECOVERING, DeviceState.CAPTURING)


@pytest.mark.parametrize("state", [DeviceState.ABSENT, DeviceState.RECOVERING, DeviceState.FAILED])
def test_from_trouble_the_way_to_the_stream_leads_through_opening(state: DeviceState) -> None:
    streaming = {DeviceState.NO_SIGNAL, DeviceState.READY, DeviceState.CAPTURING}
    assert DeviceState.OPENING in TRANSITIONS[state]
    assert not streaming & TRANSITIONS[state]


@pytest.mark.parametrize("state", [one for one in DeviceState if one is not DeviceState.ENDED])
def test_every_state_but_the_end_can_come_to_trouble(state: DeviceState) -> None:
    for trouble in (DeviceState.ABSENT, DeviceState.RECOVERING, DeviceState.FAILED):
        assert may_follow(state, trouble)
