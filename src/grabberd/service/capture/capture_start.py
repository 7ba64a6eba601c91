"""How a device's captures begin, and which of them there is."""

import threading
from collections.abc import Callable

from grabberd.acquisition import Signal, StreamInfo
from grabberd.errors import CaptureRunning, Conflict, InputError, NotReady
from grabberd.service.capture.armed_capture import ArmedCapture
from grabberd.service.capture.capture_group import Moment
from grabberd.service.capture.capture_request import Planned
from grabberd.service.capture.recorder import CaptureRequest
from grabberd.service.capture.recording import Recording
from grabberd.service.capture.recording_start import Attaching, Taken, ring_bytes_per_field
from grabberd.service.device.device_state import DeviceState
from grabberd.service.device.status_board import StatusBoard
from grabberd.service.setup import DeviceSetup, check_stream

ACCEPTS = frozenset({DeviceState.READY, DeviceState.NO_SIGNAL, DeviceState.CAPTURING})


class CaptureStart:
    """The steps from an order to a capture, for `together`, which takes them for one device or for several.

    Args:
        board: of the device.
        attaching: what its captures are put together from.
        setup: gives what it is made of now.

    Attributes:
        name: of the device.
        lock: held by whoever takes steps, or changes what must stay as it is during a capture.
        session: the running or the last capture; `waiting`: the one that is armed, or None.
    """

    def __init__(self, board: StatusBoard, attaching: Attaching, setup: Callable[[], DeviceSetup]) -> None:
        self.name = board.name
        self.lock = threading.Lock()
        self.session: Recording | None = None
        self.waiting: ArmedCapture | None = None
        self._board = board
        self._intake = attaching.intake
        self._attaching = attaching
        self._setup = setup

    @property
    def accepts(self) -> bool:
        """Whether a capture could be started, were none running."""
        status = self._board.now
        return status.state in ACCEPTS and status.stream is not None

    @property
    def bytes_per_s(self) -> float:
        """What a capture is expected to write, with the ring as it is."""
        return self.stream.rate_hz * ring_bytes_per_field(self._setup(), self._intake.armed)

    @property
    def stream(self) -> StreamInfo:
        """What the driver granted; asked only of a device that accepts captures."""
        stream = self._board.now.stream
        assert stream is not None
        return stream

    def check_no_capture(self) -> None:
        """Whether there is none.

        Raises:
            CaptureRunning: one is armed, or being recorded, measured or sealed.
        """
        if self.session is not None and not self.session.sealed.is_set():
            raise CaptureRunning(self.session.id)
        if self.waiting is not None:
            raise CaptureRunning(self.waiting.id)

    def check_free(self, request: CaptureRequest) -> None:
        """Whether a capture may begin, or be armed.

        Raises:
            CaptureRunning: there is one.
            NotReady: the device does not stream.
            InputError: the ring has not so many slots for what was before.
            CalibrationMismatch: the calibration is of pictures of another size than the stream's.
        """
        self.check_no_capture()
        self.check_streams()
        slots = self._intake.armed.ring.slots
        if request.pre_trigger_fields > slots:
            raise InputError(
                f"pre_trigger_fields is {request.pre_trigger_fields}, but the ring has {slots} slots",
                f"ask for fewer, or raise devices.{self.name}.ring.slots",
            )

    def check_armed(self, capture_id: str) -> ArmedCapture:
        """The capture, if it is armed.

        Raises:
            Conflict: it is not.
        """
        if self.waiting is None or self.waiting.id != capture_id:
            raise Conflict(f"capture {capture_id} is not armed", "it was triggered or has ended already")
        return self.waiting

    def check_streams(self) -> None:
        """Whether the device delivers pictures that can be measured, if they are to be.

        Raises:
            NotReady, CalibrationMismatch: see `check_free`.
        """
        if not self.accepts:
            status = self._board.now
            cause = f" ({status.cause})" if status.cause else ""
            raise NotReady(
                f"device {self.name} is {status.state}{cause}",
                status.hint or "wait until its state is ready: GET /api/v1/state",
            )
        self.check_measurable()

    def check_measurable(self) -> None:
        """Whether what streams now, if anything, has the calibration's size.

        Raises:
            CalibrationMismatch: it has not.
        """
        stream, measuring = self._board.now.stream, self._setup().measuring
        if measuring is not None and stream is not None:
            check_stream(measuring.calibration, stream)

    def arm(self, request: CaptureRequest) -> None:
        """The ring as the capture wants it; its threshold is chosen, where there is a picture, and held."""
        armed = self._intake.arm(request.bits, request.lines)
        if self._board.now.signal is not Signal.ABSENT:
            self._intake.thresholds.settle(armed)
        self._intake.thresholds.hold()

    def release(self) -> None:
        """There is no capture after all."""
        self._intake.thresholds.release()

    def wait(self, planned: Planned, armed_utc: str) -> None:
        """Keeps the ring so until the trigger."""
        ring = self._intake.armed
        self.waiting = ArmedCapture(
            planned.id, self.name, armed_utc, planned.request, ring.bits, ring.lines, planned.group
        )

    def disarm(self, capture_id: str) -> None:
        """Ends an armed capture, of which nothing is left.

        Raises:
            Conflict: it is not armed.
        """
        with self.lock:
            self.check_armed(capture_id)
            self.waiting = None
            self.release()

    def take(self, planned: Planned) -> Taken:
        """Fields are taken from this moment on."""
        return self._attaching.take(planned, self.stream)

    def attach(self, planned: Planned, taken: Taken, start: Moment) -> Recording:
        """A capture that can be begun; takes its time.

        Raises:
            StorageError: its file cannot be created.
        """
        return self._attaching.attach(planned, self._setup(), self.stream, taken, start)

    def begin(self, session: Recording) -> None:
        """Starts it."""
        self.session, self.waiting = session, None
        session.start()
