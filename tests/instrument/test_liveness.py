"""Capture threads that do not go on: who says so, and after which time."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from scripted import Scripted
from simulated_time import SMALL, NoCaptures, SimulatedClock
from slots import ManualClock

from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause, DeviceLost, DeviceRefused
from grabberd.instrument.acquisition import GrabbedField, StreamInfo
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.status_board import (
    SLOW_AFTER_S,
    STUCK_AFTER_S,
    TRANSITIONS,
    Liveness,
    StatusBoard,
)

PATIENCE_S = 30.0
S = DeviceState
WAY_TO = {
    S.OPENING: (S.OPENING,),
    S.ABSENT: (S.OPENING, S.ABSENT),
    S.NO_SIGNAL: (S.OPENING, S.NO_SIGNAL),
    S.READY: (S.OPENING, S.READY),
    S.CAPTURING: (S.OPENING, S.READY, S.CAPTURING),
    S.RECOVERING: (S.OPENING, S.RECOVERING),
    S.FAILED: (S.OPENING, S.FAILED),
    S.ENDED: (S.OPENING, S.ENDED),
}


class Watched:
    """One board that nobody beats on unless the test does, and who looks after it once a second."""

    def __init__(self, state: DeviceState = S.READY) -> None:
        self.clock = ManualClock()
        self.board = StatusBoard("cup", self.clock)
        for one in WAY_TO[state]:
            self.board.enter(one)
        self.liveness = Liveness([self.board])

    def look(self) -> None:
        self.liveness.look(self.clock.now_ns() / 1e9)

    def pass_s(self, seconds: float, *, beating: bool = False) -> None:
        for _ in range(round(seconds)):
            self.clock.advance(1.0)
            if beating:
                self.board.beat()
            self.look()

    def stuck_after_s(self) -> int:
        """Seconds of silence after which the state says so."""
        for passed_s in range(60):
            if self.board.now.code is Cause.CAPTURE_STUCK:
                return passed_s
            self.pass_s(1)
        raise AssertionError("nobody ever says that the thread is stuck")


def test_every_state_has_a_way_to_it() -> None:
    assert set(WAY_TO) == set(DeviceState) == set(TRANSITIONS)


@pytest.mark.parametrize("state", DeviceState)
def test_a_silent_thread_is_said_to_be_stuck_in_every_state(state: DeviceState) -> None:
    limit_s = STUCK_AFTER_S if state in {S.NO_SIGNAL, S.READY, S.CAPTURING} else SLOW_AFTER_S
    one = Watched(state)
    assert limit_s < one.stuck_after_s() <= limit_s + 2
    assert one.board.state is one.board.now.state is S.FAILED
    assert one.board.now.hint


@pytest.mark.parametrize("state", DeviceState)
def test_a_silent_thread_has_the_daemon_restarted_in_every_state(state: DeviceState) -> None:
    one = Watched(state)
    one.pass_s(SLOW_AFTER_S)
    assert one.liveness.is_well
    one.pass_s(2)
    assert not one.liveness.is_well
    assert one.liveness.silent == ("cup",)


@pytest.mark.parametrize("state", DeviceState)
def test_a_thread_that_beats_is_well_in_every_state(state: DeviceState) -> None:
    one = Watched(state)
    one.pass_s(100, beating=True)
    assert one.board.state is state
    assert one.liveness.is_well


def test_it_is_said_once_and_taken_back_when_the_thread_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    one = Watched()
    one.pass_s(12)
    one.board.beat()
    assert (one.board.state, one.board.now.cause) == (S.READY, None)
    said = [record.message for record in caplog.records]
    assert len(said) == 2
    assert "has not answered for 6 s" in said[0]
    assert "continues after 12 s" in said[1]


def test_a_whole_program_that_stood_still_has_no_stuck_thread() -> None:
    one = Watched()
    one.pass_s(3, beating=True)
    one.clock.advance(30.0)
    one.look()
    assert one.liveness.is_well
    assert one.board.state is S.READY
    one.board.beat()
    one.pass_s(3)
    assert one.board.state is S.READY


def test_an_event_loop_that_is_always_late_finds_a_stuck_thread_all_the_same() -> None:
    one = Watched()
    for _ in range(10):
        one.clock.advance(3.0)
        one.look()
    assert one.board.now.code is Cause.CAPTURE_STUCK


class Hanging(Scripted):
    """A grabber whose driver does not return from one of its calls, until the test lets it."""

    def __init__(self, clock: SimulatedClock, call: str) -> None:
        errors: dict[str, list[Exception | int]] = {
            "open": [],
            "reopen": [1, DeviceLost("gone", "")],
            "close": [DeviceRefused("busy", "")],
        }
        super().__init__(clock, *errors.get(call, []), *[1] * 100_000)
        self.call = call
        self.hangs, self.goes_on = threading.Event(), threading.Event()

    def _hang(self, call: str) -> None:
        if call == self.call and not self.goes_on.is_set():
            self.hangs.set()
            assert self.goes_on.wait(PATIENCE_S)

    def open(self) -> StreamInfo:
        self._hang("open")
        if self.asked.count("open") == 1:
            self._hang("reopen")
        return super().open()

    def close(self) -> None:
        if "open" in self.asked:
            self._hang("close")
        super().close()

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        self._hang("dequeue")
        with super().dequeue(timeout_s) as fields:
            yield fields


class Deadlocked(NoCaptures):
    """Captures whose lock somebody holds for ever: the program's own fault."""

    def __init__(self) -> None:
        super().__init__(lambda _: None, lambda _: None)
        self.hangs, self.goes_on = threading.Event(), threading.Event()

    @property
    def is_recording(self) -> bool:  # type: ignore[override]
        self.hangs.set()
        assert self.goes_on.wait(PATIENCE_S)
        return False


@pytest.mark.parametrize("call", ["open", "reopen", "close", "dequeue", "python"])
def test_a_real_thread_that_hangs_is_found_and_goes_on_when_it_can(call: str) -> None:
    clock = ManualClock()
    board = StatusBoard("cup", clock)
    grabber, captures = Hanging(SimulatedClock(), call), Deadlocked()
    if call != "python":
        captures.goes_on.set()
    else:
        grabber.goes_on.set()
    hung = captures if call == "python" else grabber
    thread = CaptureThread("cup", grabber, FieldPipeline(SMALL), board, clock, captures)
    thread.start()
    try:
        assert hung.hangs.wait(PATIENCE_S)
        liveness = Liveness([board])
        for _ in range(17):
            clock.advance(1.0)
            liveness.look(clock.now_ns() / 1e9)
        assert board.now.code is Cause.CAPTURE_STUCK
        assert not liveness.is_well
        hung.goes_on.set()
        with board.changed:
            assert board.changed.wait_for(lambda: board.now.code is not Cause.CAPTURE_STUCK, PATIENCE_S)
        liveness.look(clock.now_ns() / 1e9)
        assert liveness.is_well
    finally:
        hung.goes_on.set()
        thread.stop()
        thread.join(PATIENCE_S)
    assert not thread.is_alive()
