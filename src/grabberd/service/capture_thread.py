"""The only thread that touches a device: open until it works, run until something fails."""

import logging
import threading
from collections.abc import Callable

from grabberd.acquisition.device import Grabber, Signal, StreamInfo
from grabberd.errors import DeviceAbsent, DeviceError, DeviceRefused, GrabberdError, PictureError, StreamEnded
from grabberd.service.clock import Clock
from grabberd.service.intake import Intake
from grabberd.service.states import DeviceState
from grabberd.service.status import StatusBoard

log = logging.getLogger(__name__)

DEQUEUE_TIMEOUT_S = 0.25
STALLED_AFTER_NS = 1_000_000_000
SIGNAL_EVERY_NS = 1_000_000_000
RETRY_S = 0.5
ROOM_POLL_S = 0.001


class CaptureThread(threading.Thread):
    """Opens the device, takes its fields into the ring, and begins again when it is gone.

    It never waits for anybody, but for a source that waits for its reader: that is read only while
    `has_room` says so.
    """

    def __init__(
        self,
        name: str,
        grabber: Grabber,
        intake: Intake,
        board: StatusBoard,
        clock: Clock,
        *,
        has_room: Callable[[], bool],
        is_capturing: Callable[[], bool],
        on_end: Callable[[GrabberdError], None],
    ) -> None:
        super().__init__(name=f"capture-{name}", daemon=True)
        self._grabber = grabber
        self._intake = intake
        self._board = board
        self._clock = clock
        self._has_room = has_room
        self._is_capturing = is_capturing
        self._on_end = on_end
        self._stopping = threading.Event()
        self._last_field_ns = 0
        self._signal_due_ns = 0
        self._signal = Signal.UNKNOWN

    def stop(self) -> None:
        """Ends the thread within a dequeue's time-out; the device is closed."""
        self._stopping.set()

    def run(self) -> None:
        """Until stopped."""
        while not self._stopping.is_set():
            self._until_something_fails()
            self._stopping.wait(RETRY_S)

    def _until_something_fails(self) -> None:
        self._board.enter(DeviceState.OPENING)
        try:
            info = self._grabber.open()
            self._opened(info)
            while not self._stopping.is_set():
                self._step(info)
        except DeviceError as error:
            self._failed(error)
        except PictureError as error:
            self._ended(error)
        except Exception as error:
            log.exception("device %s: the capture thread failed", self.name)
            self._failed(DeviceRefused(f"{type(error).__name__}: {error}", "please report this"))
        finally:
            self._grabber.close()

    def _opened(self, info: StreamInfo) -> None:
        self._intake.opened(info)
        self._board.opened(info)
        self._last_field_ns = self._clock.now_ns()
        self._signal_due_ns = 0
        self._ask_signal()

    def _step(self, info: StreamInfo) -> None:
        if info.waits_for_reader and not self._has_room():
            self._last_field_ns = self._clock.now_ns()
            self._stopping.wait(ROOM_POLL_S)
            return
        with self._grabber.dequeue(DEQUEUE_TIMEOUT_S) as fields:
            now_ns = self._clock.now_ns()
            for grabbed in fields:
                self._board.count(self._intake.take(grabbed, self._signal, now_ns))
        if fields:
            self._last_field_ns = now_ns
        elif now_ns - self._last_field_ns > STALLED_AFTER_NS:
            raise DeviceError(f"no field for {STALLED_AFTER_NS / 1e9:.1f} s", "it is being opened again")
        self._ask_signal()

    def _ask_signal(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns >= self._signal_due_ns:
            self._signal_due_ns = now_ns + SIGNAL_EVERY_NS
            self._signal = self._grabber.signal()
            self._board.saw_signal(self._signal)
        self._board.enter(self._state(), "no camera signal" if self._signal is Signal.ABSENT else None)

    def _state(self) -> DeviceState:
        if self._signal is Signal.ABSENT:
            return DeviceState.NO_SIGNAL
        return DeviceState.CAPTURING if self._is_capturing() else DeviceState.READY

    def _failed(self, error: DeviceError) -> None:
        if isinstance(error, StreamEnded):
            self._ended(error)
            return
        self._intake.interrupted(_reason(error))
        state = self._board.state
        if state is DeviceState.OPENING:
            refused = isinstance(error, DeviceRefused)
            self._board.enter(DeviceState.FAILED if refused else DeviceState.ABSENT, error.message)
        else:
            self._board.enter(DeviceState.RECOVERING, error.message)

    def _ended(self, error: GrabberdError) -> None:
        self._board.enter(DeviceState.ENDED, error.message)
        self._on_end(error)
        self._stopping.wait()


def _reason(error: DeviceError) -> str:
    return "unplugged" if isinstance(error, DeviceAbsent) else error.message
