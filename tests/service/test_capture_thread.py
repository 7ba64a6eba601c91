"""The capture thread: open until it works, run until something fails."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest

from grabberd.acquisition import FieldOrder, GrabbedField, Outcome, Signal, StreamInfo
from grabberd.config import DeviceConfig
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, GrabberdError, StreamEnded
from grabberd.field import Field
from grabberd.service.capture_thread import CaptureThread
from grabberd.service.clock import SystemClock
from grabberd.service.intake import Intake
from grabberd.service.states import DeviceState
from grabberd.service.status import StatusBoard

PATIENCE_S = 20.0
INFO = StreamInfo("script", "card", "PAL", 16, 8, 50.0, FieldOrder.ALTERNATE, "GREY", 8, False, True, True, 0)


class Scripted:
    """A grabber that follows a script: an error to raise, or how many fields to give."""

    def __init__(self, *script: GrabberdError | int) -> None:
        self.script = list(script)
        self.n = 0
        self.closed = 0
        self.reading = Signal.PRESENT

    def open(self) -> StreamInfo:
        if self.script and isinstance(self.script[0], DeviceAbsent | DeviceRefused):
            raise self.script.pop(0)  # type: ignore[misc]
        return INFO

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        step = self.script.pop(0) if self.script else StreamEnded("the script is over", "")
        if not isinstance(step, int):
            raise step
        yield [self._field() for _ in range(step)]

    def _field(self) -> GrabbedField:
        luma = np.full((8, 16), 40 + self.n, np.uint8)
        grabbed = GrabbedField(Field.intact(luma, self.n % 2), self.n * 20_000_000 + 1, self.n, None)
        self.n += 1
        return grabbed

    def signal(self) -> Signal:
        return self.reading

    def close(self) -> None:
        self.closed += 1


class Run:
    """A capture thread over a script, until the script is over."""

    def __init__(self, *script: GrabberdError | int, signal: Signal = Signal.PRESENT) -> None:
        self.grabber = Scripted(*script)
        self.grabber.reading = signal
        self.intake = Intake(DeviceConfig(driver="script"))
        self.board = StatusBoard("script", SystemClock())
        self.states: list[DeviceState] = []
        self.ended: list[GrabberdError] = []
        over = threading.Event()
        enter = self.board.enter

        def noted(state: DeviceState, cause: str | None = None) -> None:
            enter(state, cause)
            if not self.states or self.states[-1] is not state:
                self.states.append(state)

        self.board.enter = noted  # type: ignore[method-assign]
        thread = CaptureThread(
            "script",
            self.grabber,
            self.intake,
            self.board,
            SystemClock(),
            has_room=lambda: True,
            is_capturing=lambda: False,
            on_end=lambda error: (self.ended.append(error), over.set())[0],
        )
        thread.start()
        assert over.wait(PATIENCE_S)
        thread.stop()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def test_fields_go_into_the_ring_in_order() -> None:
    run = Run(1, 2, 1)
    newest = run.intake.armed.ring.newest
    assert newest
    assert newest.n == 3
    assert run.board.now.outcomes[Outcome.RECEIVED] == 4
    assert run.states == [DeviceState.OPENING, DeviceState.READY, DeviceState.ENDED]


def test_an_absent_device_is_tried_again_until_it_is_there() -> None:
    run = Run(DeviceAbsent("not there", ""), DeviceAbsent("not there", ""), 1)
    absent = [DeviceState.OPENING, DeviceState.ABSENT]
    assert run.states == [*absent, *absent, DeviceState.OPENING, DeviceState.READY, DeviceState.ENDED]


def test_a_device_that_says_no_is_failed_and_tried_again() -> None:
    run = Run(DeviceRefused("busy", ""), 1)
    assert run.states[:3] == [DeviceState.OPENING, DeviceState.FAILED, DeviceState.OPENING]


def test_a_lost_device_is_closed_and_opened_again() -> None:
    run = Run(2, DeviceLost("unplugged", ""), 1)
    assert run.states == [
        DeviceState.OPENING,
        DeviceState.READY,
        DeviceState.RECOVERING,
        DeviceState.OPENING,
        DeviceState.READY,
        DeviceState.ENDED,
    ]
    assert run.grabber.closed == 2
    assert run.board.now.openings == 2


def test_without_signal_the_state_says_so() -> None:
    run = Run(1, 1, signal=Signal.ABSENT)
    assert DeviceState.NO_SIGNAL in run.states
    assert run.board.now.outcomes[Outcome.NO_SIGNAL] == 2


def test_a_fault_of_the_program_does_not_end_the_thread(caplog: pytest.LogCaptureFixture) -> None:
    run = Run(1, ValueError("a fault"), 1)  # type: ignore[arg-type]
    assert run.board.now.outcomes[Outcome.RECEIVED] == 2
    assert "capture thread failed" in caplog.text


def test_the_end_of_a_recording_is_told() -> None:
    run = Run(1)
    assert [error.message for error in run.ended] == ["the script is over"]
    assert run.board.state is DeviceState.ENDED
