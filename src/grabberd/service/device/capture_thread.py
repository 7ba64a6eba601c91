"""The only thread that touches a device: opens it, takes its fields, and helps it when none come."""

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass

from grabberd.acquisition.device import Grabber, Signal, StreamInfo
from grabberd.acquisition.ledger import NO_SIGNAL
from grabberd.documents.states import Rung
from grabberd.errors import (
    Cause,
    DeviceError,
    DeviceRefused,
    GrabberdError,
    PictureError,
    StreamEnded,
    StreamFailed,
)
from grabberd.service.clock import Clock
from grabberd.service.device.device_state import DeviceState
from grabberd.service.device.field_flow import Flow
from grabberd.service.device.field_pipeline import FieldPipeline
from grabberd.service.device.recovery import Failure, Ladder, Step, reason_of, trouble_of
from grabberd.service.device.status_board import StatusBoard, cause_of

log = logging.getLogger(__name__)

DEQUEUE_TIMEOUT_S = 0.05
STALLED_AFTER_S = 0.8
SIGNAL_EVERY_NS = 500_000_000
ROOM_POLL_S = 0.001
BEAT_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class Captures:
    """The captures of a device, as its capture thread sees them.

    Attributes:
        has_room: whether a source that waits for its reader may deliver another field.
        running: whether there is one.
        interrupted: told with the error whenever fields fail to come.
        ended: told when the stream that there was is over: a recording at its end, a device that grants
            another picture than before.
    """

    has_room: Callable[[], bool]
    running: Callable[[], bool]
    interrupted: Callable[[GrabberdError], None]
    ended: Callable[[GrabberdError], None]


class CaptureThread(threading.Thread):
    """Opens the device, takes its fields into the ring, and climbs the ladder when they fail to come.

    It never waits for anybody, but for a source that waits for its reader: that is read only while there is
    room. All other waiting is done on `stopping`, which `stop` sets. It beats on the board as long as it
    lives.
    """

    def __init__(
        self,
        name: str,
        grabber: Grabber,
        intake: FieldPipeline,
        board: StatusBoard,
        clock: Clock,
        captures: Captures,
        stopping: threading.Event | None = None,
    ) -> None:
        super().__init__(name=f"capture-{name}", daemon=True)
        self._grabber = grabber
        self._intake = intake
        self._board = board
        self._clock = clock
        self._captures = captures
        self._stopping = stopping or threading.Event()
        self._open = False
        self._flow = Flow(clock.now_ns())
        self._signal_due_ns = 0
        self._signal = Signal.UNKNOWN
        self._last_fault: str | None = None
        self._take_step: dict[Rung, Callable[[], StreamInfo]] = {
            Rung.RESTART: grabber.restart,
            Rung.REOPEN: self._reopen,
            Rung.RESET: self._reset,
            Rung.RETRY: self._reopen,
        }

    def stop(self) -> None:
        """Ends the thread within a dequeue's time-out; the device is closed."""
        self._stopping.set()

    def run(self) -> None:
        """Until stopped."""
        self._board.enter(DeviceState.OPENING)
        ladder, rung = Ladder(), Rung.REOPEN
        try:
            while (error := self._until_it_fails(rung)) is not None:
                failure = Failure(trouble_of(error), self._open, self._flow.flowed_s)
                ladder, step = ladder.next(failure, self._clock.now_ns())
                self._prepare(step, error)
                rung = step.rung
        finally:
            self._close()

    def _until_it_fails(self, rung: Rung) -> GrabberdError | None:
        """Takes a step, then fields; why they come no more, or None when it is stopped."""
        self._flow = Flow(self._clock.now_ns())
        self._board.beat()
        try:
            if not self._stopping.is_set():
                self._stream(self._take_step[rung]())
        except (StreamEnded, PictureError) as error:
            self._ended(error)
        except DeviceError as error:
            return error
        except Exception as error:
            return self._fault(error)
        return None

    def _fault(self, error: Exception) -> GrabberdError:
        words = f"{type(error).__name__}: {error}"
        if words != self._last_fault:
            self._last_fault = words
            log.exception("device %s: the capture thread failed", self.name)
        return DeviceRefused(words, "please report this", Cause.FAULT)

    def _prepare(self, step: Step, error: GrabberdError) -> None:
        self._interrupted(reason_of(error))
        self._captures.interrupted(error)
        self._board.recovers(step, error)
        if step.rung is not Rung.RESTART:
            self._close()  # before the wait: a device that is held cannot come back under its old name
        self._wait(step.wait_s)

    def _interrupted(self, reason: str) -> None:
        """The first reason is what the fields are lost for; what is found out later only follows from it."""
        if self._intake.interruption is None:
            self._intake.interrupted(reason)

    def _close(self) -> None:
        self._grabber.close()
        self._open = False

    def _reopen(self) -> StreamInfo:
        self._close()
        info = self._grabber.open()
        self._open = True
        return info

    def _reset(self) -> StreamInfo:
        self._close()
        try:
            self._grabber.reset()
            self._board.reset_refused(None)
        except DeviceRefused as refusal:
            self._board.reset_refused(refusal)
        return self._reopen()

    def _stream(self, info: StreamInfo) -> None:
        self._opened(info)
        while not self._stopping.is_set():
            self._take(info)

    def _opened(self, info: StreamInfo) -> None:
        self._board.enter(DeviceState.OPENING)
        change = self._intake.opened(info)
        self._board.opened(info)
        if change:
            log.warning("device %s: %s", self.name, change)
            self._captures.ended(DeviceRefused(change, "begin a new capture"))
        self._flow = Flow(self._clock.now_ns())
        self._ask_signal()
        if info.waits_for_reader:
            self._show_state()

    def _take(self, info: StreamInfo) -> None:
        self._board.beat()
        asked_ns = self._clock.now_ns()
        if info.waits_for_reader and not self._captures.has_room():
            self._flow.excuse(asked_ns)
            self._show_state()
            self._stopping.wait(ROOM_POLL_S)
            return
        with self._grabber.dequeue(DEQUEUE_TIMEOUT_S) as fields:
            now_ns = self._clock.now_ns()
            for grabbed in fields:
                self._board.count(self._intake.take(grabbed, self._signal, now_ns))
        if now_ns >= self._signal_due_ns:
            self._ask_signal()
        if fields:
            self._flow.came(now_ns)
            self._show_state()
        elif info.live or info.waits_for_reader:  # another recording may pause
            self._nothing_came(asked_ns, now_ns)

    def _nothing_came(self, asked_ns: int, now_ns: int) -> None:
        """Many grabbers deliver nothing without a camera: nothing is wrong with them.

        What counts is when the empty dequeue began: so a computer that stood still is not taken for a grabber
        that did.
        """
        if self._signal is Signal.ABSENT:
            self._flow.excuse(now_ns)
            self._interrupted(NO_SIGNAL)
            self._show_state()
        elif self._flow.silent_s(asked_ns) > STALLED_AFTER_S - DEQUEUE_TIMEOUT_S:
            raise StreamFailed(
                f"no field for {STALLED_AFTER_S} s", "if it stays, check camera, cable and port"
            )

    def _ask_signal(self) -> None:
        self._signal_due_ns = self._clock.now_ns() + SIGNAL_EVERY_NS
        self._signal = self._grabber.signal()
        self._board.saw_signal(self._signal)

    def _show_state(self) -> None:
        if self._signal is Signal.ABSENT:
            self._board.enter(DeviceState.NO_SIGNAL, "no camera signal", None, Cause.NO_SIGNAL)
        elif made_up := self._intake.no_picture:
            self._board.enter(DeviceState.NO_SIGNAL, made_up, None, Cause.NO_PICTURE)
        else:
            self._board.enter(self._state())

    def _state(self) -> DeviceState:
        return DeviceState.CAPTURING if self._captures.running() else DeviceState.READY

    def _ended(self, error: GrabberdError) -> None:
        self._board.enter(DeviceState.ENDED, error.message, error.hint, cause_of(error))
        self._captures.ended(error)
        self._wait(math.inf)

    def _wait(self, seconds: float) -> None:
        """Until stopped, or for so long; it lives meanwhile."""
        end_ns = self._clock.now_ns() + seconds * 1e9
        while (left_s := (end_ns - self._clock.now_ns()) / 1e9) > 0:
            if self._stopping.wait(min(left_s, BEAT_EVERY_S)):
                return
            self._board.beat()
