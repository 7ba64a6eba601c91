"""The instrument around one grabber: its threads, its ring, its calibration and its captures."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from grabberd.archive.catalogue.disk_guard import DiskGuard
from grabberd.archive.measure_setups import check_rig
from grabberd.config import DeviceConfig
from grabberd.core.geometry import Calibration
from grabberd.documents.requests import CaptureRequest
from grabberd.errors import InputError
from grabberd.instrument.capture import capture_start
from grabberd.instrument.capture.capture_request import NewCapture
from grabberd.instrument.capture.capture_start import CaptureStart
from grabberd.instrument.capture.device_captures import CurrentCaptures, DeviceCaptures, check_stream
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.device.capture_thread import CaptureThread
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.scheduling import KernelAccount
from grabberd.instrument.device.status_board import StatusBoard
from grabberd.instrument.device.worker import FairLock, Worker
from grabberd.instrument.setup import DeviceSetup
from grabberd.runtime import SystemClock, UtcClock


class Instrument:
    """Streams and measures from start to stop; captures when asked.

    Args:
        setup: Configuration, grabber and calibration of the device.
        clock: Source of time.
        site: The configuration's `site`, copied into every capture.
        queue_s: Seconds of fields that may wait for a stalled disk.
        disk: Guard of the captures' disk.
        on_sealed: Called with each recording once its file is closed.
        fair_lock: Taken in turn by the workers of all devices.
        loggers: The data loggers, whose channels its captures record.

    Attributes:
        name: Name of the device.
        board: Its status.
        pipeline: Its ring and threshold.
        captures: Its captures.
        worker: Its live points; waits while there is no calibration or no object model.
    """

    def __init__(
        self,
        setup: DeviceSetup,
        clock: UtcClock,
        *,
        site: dict[str, str] | None = None,
        queue_s: float = 10.0,
        disk: DiskGuard | None = None,
        on_sealed: Callable[[Recording], None] = lambda _: None,
        fair_lock: FairLock | None = None,
        loggers: Loggers | None = None,
    ) -> None:
        self.name = setup.name
        self.board = StatusBoard(setup.name, clock)
        self.pipeline = FieldPipeline(setup.config)
        self.captures = DeviceCaptures(
            setup,
            self.board,
            self.pipeline,
            clock,
            disk or DiskGuard(),
            site or {},
            queue_s,
            on_sealed,
            loggers or Loggers({}, clock),
        )
        self.worker = Worker(self.name, setup.measuring, self.pipeline, self.captures, clock, fair_lock)
        # The kernel's accounting uses its own clock only. With another clock, a thread may take fields
        # without a pause, which in real time would block all others.
        account = KernelAccount() if type(clock) is SystemClock else None
        self._capture_thread = CaptureThread(
            self.name, setup.grabber, self.pipeline, self.board, clock, self.captures, account=account
        )

    def start(self) -> None:
        """Starts streaming and measuring."""
        self._capture_thread.start()
        self.pipeline.thresholds.start(self.name)
        self.worker.start()

    def stop(self, timeout_s: float = 20.0) -> None:
        """Ends a running capture, seals its file and closes the device."""
        # The capture first: its last fields still come from the ring, and its points from the worker.
        recording = self.captures.recording
        if recording is not None:
            recording.stop("the daemon stopped")
            recording.sealed.wait(timeout_s)
        # All are asked to end before any is joined.
        self._capture_thread.stop()
        self.worker.stop()
        self.pipeline.thresholds.stop(timeout_s)
        self.worker.join(timeout_s)
        self._capture_thread.join(timeout_s)

    @property
    def setup(self) -> DeviceSetup:
        """Configuration, grabber and calibration of the device; replaced between captures only."""
        return self.captures.setup

    def start_capture(self, capture_id: str, request: CaptureRequest, part: Path) -> Recording:
        """Starts a capture without a service, into a file chosen by the caller.

        Args:
            capture_id: Id of the capture.
            request: Its options.
            part: Path of its file while it is written.

        Raises:
            CaptureRunning, NotReady, InputError, CalibrationMismatch, StorageError: See
                `capture_start.start`.
        """
        single = CaptureStart(self.captures, NewCapture(capture_id, request, part))
        capture_start.start([single], CurrentCaptures({self.name: self.captures}))
        assert self.captures.recording is not None
        return self.captures.recording

    @contextmanager
    def between_captures(self) -> Iterator[None]:
        """Prevents captures during changes that would affect recording or measuring.

        Raises:
            CaptureRunning: One is armed, or being recorded, measured or sealed.
        """
        with self.captures.lock:
            self.captures.check_no_capture()
            yield

    def use(self, setup: DeviceSetup) -> None:
        """Measures with another calibration from the next field on; called `between_captures`."""
        self.captures.setup = setup
        self.worker.use(setup.measuring)

    def configure(self, config: DeviceConfig) -> None:
        """Chooses the threshold by another configuration; called `between_captures`."""
        self.captures.setup = replace(self.setup, config=config)
        self.pipeline.thresholds.use(config)

    def check_fits(self, calibration: Calibration) -> None:
        """Checks that the pictures of this device may be measured with a calibration.

        Raises:
            CalibrationMismatch: It is for another rig, or for pictures of another size than the stream's.
        """
        check_rig(calibration, self.setup.config.rig)
        stream = self.board.now.stream
        if stream is not None:
            check_stream(calibration, stream)

    @property
    def misfit(self) -> str | None:
        """The reason why the calibration does not fit the pictures, or None."""
        try:
            self.captures.check_measurable()
        except InputError as error:
            return f"{error.message}: no points are measured"
        return None
