"""One grabber made into an instrument: its threads, its ring and at most one capture."""

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd.acquisition import Signal, StreamInfo
from grabberd.config import DeviceConfig
from grabberd.errors import CalibrationMismatch, CaptureRunning, Conflict, GrabberdError, InputError, NotReady
from grabberd.geometry import Calibration
from grabberd.service.armed import Armed
from grabberd.service.attaching import Attaching, ring_bytes_per_field
from grabberd.service.capture_thread import Captures, CaptureThread
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.disk import DiskGuard
from grabberd.service.intake import Intake
from grabberd.service.recorder import CaptureRequest
from grabberd.service.session import CaptureSession
from grabberd.service.setup import DeviceSetup, check_rig, check_stream
from grabberd.service.states import DeviceState
from grabberd.service.status import StatusBoard
from grabberd.service.waiting import WaitingCapture
from grabberd.service.worker import Worker

NOMINAL_RATE_HZ = 50.0
ACCEPTS = frozenset({DeviceState.READY, DeviceState.NO_SIGNAL, DeviceState.CAPTURING})


class Instrument:
    """Streams and measures from start to stop; captures when asked.

    Attributes:
        name: of the device.
        setup: what it is made of; its calibration may be exchanged between captures.
        board: its status.
        intake: its ring and threshold.
        worker: its live points; it waits while there is no calibration or no object model.
        session: the running or the last capture; `waiting`: the one that is armed, or None.
        ended: how many captures have ended complete, and how many incomplete.
    """

    def __init__(
        self,
        setup: DeviceSetup,
        clock: Clock,
        *,
        site: dict[str, str] | None = None,
        queue_s: float = 10.0,
        disk: DiskGuard | None = None,
        on_sealed: Callable[[CaptureSession], None] = lambda _: None,
    ) -> None:
        self.name = setup.name
        self.setup = setup
        self.board = StatusBoard(setup.name, clock)
        self.intake = Intake(setup.config)
        self.session: CaptureSession | None = None
        self.waiting: WaitingCapture | None = None
        self.ended: Counter[str] = Counter()
        self._clock = clock
        self._attaching = Attaching(
            self.intake, clock, disk or DiskGuard(), site or {}, queue_s, self._sealed
        )
        self._on_sealed = on_sealed
        self._starting = threading.Lock()
        self.worker = Worker(self.name, setup.measuring, self.intake, lambda: self.session, clock)
        self._capture = CaptureThread(
            self.name,
            setup.grabber,
            self.intake,
            self.board,
            clock,
            Captures(
                has_room=lambda: self.running is not None and self.running.has_room,
                running=lambda: self.running is not None,
                interrupted=self._interrupted,
                ended=self._source_ended,
            ),
        )

    def start(self) -> None:
        """Starts streaming and measuring."""
        self._capture.start()
        self.intake.thresholds.start(self.name)
        self.worker.start()

    def stop(self, timeout_s: float = 20.0) -> None:
        """Ends a running capture, seals its file and lets go of the device."""
        session = self.session
        if session is not None:
            session.stop("the daemon stopped")
            session.sealed.wait(timeout_s)
        self._capture.stop()
        self.worker.stop()
        self.intake.thresholds.stop(timeout_s)
        self.worker.join(timeout_s)
        self._capture.join(timeout_s)

    @property
    def accepts(self) -> bool:
        """Whether a capture could be started, were none running."""
        status = self.board.now
        return status.state in ACCEPTS and status.stream is not None

    @property
    def rate_hz(self) -> float:
        """Fields a second, as granted; nominal while the device is not open."""
        stream = self.board.now.stream
        return stream.rate_hz if stream else NOMINAL_RATE_HZ

    @property
    def bytes_per_s(self) -> float:
        """What a capture writes a second: as the running one does, else as the ring would have it."""
        session, armed = self.running, self.intake.armed
        return self.rate_hz * (
            (session and session.bytes_per_field) or ring_bytes_per_field(self.setup, armed)
        )

    @property
    def running(self) -> CaptureSession | None:
        """The capture that is recording, or None."""
        session = self.session
        return session if session is not None and session.recorder.recording else None

    def start_capture(self, capture_id: str, request: CaptureRequest, part: Path) -> CaptureSession:
        """Attaches a recorder; fields are taken from this moment on, or from the ring for a pre-trigger.

        Raises:
            CaptureRunning: one is being recorded or sealed.
            NotReady: the device does not stream.
            InputError: the ring has not so many slots for what was before.
            CalibrationMismatch: the calibration is of pictures of another size than the stream's.
            StorageError: the file cannot be created, or the disk has no room for the capture.
        """
        with self._starting:
            self._check_free()
            self._arm(request)
            try:
                session = self._attach(capture_id, request, part)
            except GrabberdError:
                self.intake.thresholds.release()
                raise
            self.session = session
            session.start()
        return session

    def arm_capture(self, capture_id: str, request: CaptureRequest) -> None:
        """Keeps the ring as a capture wants it, until it is triggered or disarmed.

        Raises:
            CaptureRunning, NotReady, InputError, CalibrationMismatch: as `start_capture`.
        """
        with self._starting:
            self._check_free()
            armed = self._arm(request)
            now_utc = iso_utc(self._clock.utc_now())
            self.waiting = WaitingCapture(capture_id, self.name, now_utc, request, armed.bits, armed.lines)

    def trigger_capture(self, capture_id: str, part: Path) -> None:
        """Has an armed capture begin: with so many slots of the ring as it wants, as far as they are there.

        Raises:
            Conflict: it is not armed.
            NotReady, CalibrationMismatch, StorageError: as `start_capture`; it stays armed.
        """
        with self._starting:
            waiting = self._armed(capture_id)
            self._check_streams()
            session = self._attach(capture_id, waiting.request, part, waiting)
            self.session, self.waiting = session, None
            session.start()

    def disarm_capture(self, capture_id: str) -> None:
        """Ends an armed capture, of which nothing is left.

        Raises:
            Conflict: it is not armed.
        """
        with self._starting:
            self._armed(capture_id)
            self.waiting = None
            self.intake.thresholds.release()

    def _armed(self, capture_id: str) -> WaitingCapture:
        if self.waiting is None or self.waiting.id != capture_id:
            raise Conflict(f"capture {capture_id} is not armed", "it was triggered or has ended already")
        return self.waiting

    @contextmanager
    def between_captures(self) -> Iterator[None]:
        """Holds captures off, for what must not change while one is recorded and measured.

        Raises:
            CaptureRunning: one is being recorded, measured or sealed.
        """
        with self._starting:
            self._check_no_capture()
            yield

    def use(self, setup: DeviceSetup) -> None:
        """Measures with another calibration from the next field on; called `between_captures`."""
        self.setup = setup
        self.worker.use(setup.measuring)

    def configure(self, config: DeviceConfig) -> None:
        """Finds its threshold as another configuration has it; called `between_captures`."""
        self.setup = replace(self.setup, config=config)
        self.intake.thresholds.use(config)

    def check_fits(self, calibration: Calibration) -> None:
        """Whether the pictures of this device may be measured with a calibration.

        Raises:
            CalibrationMismatch: it is of another rig, or of pictures of another size than the stream's.
        """
        check_rig(calibration, self.setup.config.rig)
        stream = self.board.now.stream
        if stream is not None:
            check_stream(calibration, stream)

    @property
    def misfit(self) -> str | None:
        """Why the calibration is not one of the pictures that come, or None."""
        try:
            self._check_measurable(self.board.now.stream)
        except CalibrationMismatch as error:
            return f"{error.message}: no points are measured"
        return None

    def _interrupted(self, error: GrabberdError) -> None:
        session = self.running
        if session is not None:
            session.interrupted(error)

    def _source_ended(self, error: GrabberdError) -> None:
        session = self.running
        if session is not None:
            session.source_ended(error)

    def _check_no_capture(self) -> None:
        if self.session is not None and not self.session.sealed.is_set():
            raise CaptureRunning(self.session.id)
        if self.waiting is not None:
            raise CaptureRunning(self.waiting.id)

    def _check_free(self) -> None:
        self._check_no_capture()
        self._check_streams()

    def _check_streams(self) -> None:
        if not self.accepts:
            status = self.board.now
            cause = f" ({status.cause})" if status.cause else ""
            raise NotReady(
                f"device {self.name} is {status.state}{cause}",
                status.hint or "wait until its state is ready: GET /api/v1/state",
            )

    def _arm(self, request: CaptureRequest) -> Armed:
        """The ring for a capture; its threshold is chosen, where there is a picture, and held."""
        status, slots = self.board.now, self.intake.armed.ring.slots
        if request.pre_trigger_fields > slots:
            raise InputError(
                f"pre_trigger_fields is {request.pre_trigger_fields}, but the ring has {slots} slots",
                f"ask for fewer, or raise devices.{self.name}.ring.slots",
            )
        self._check_measurable(status.stream)
        armed = self.intake.arm(request.bits, request.lines)
        if status.signal is not Signal.ABSENT:
            self.intake.thresholds.settle(armed)
        self.intake.thresholds.hold()
        return armed

    def _check_measurable(self, stream: StreamInfo | None) -> None:
        if self.setup.measuring is not None and stream is not None:
            check_stream(self.setup.measuring.calibration, stream)

    def _attach(
        self, capture_id: str, request: CaptureRequest, part: Path, waiting: WaitingCapture | None = None
    ) -> CaptureSession:
        stream = self.board.now.stream
        assert stream is not None
        self._check_measurable(stream)
        return self._attaching.attach(capture_id, self.setup, stream, request, part, waiting)

    @property
    def made_with(self) -> dict[str, Any]:
        """The documents that points are made with, as a run keeps them."""
        return self.setup.made_with

    def _sealed(self, session: CaptureSession) -> None:
        self.intake.thresholds.release()
        self.ended[session.verdict] += 1
        self._on_sealed(session)
