"""One grabber made into an instrument: its threads, its ring and at most one capture."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from grabberd import __version__
from grabberd.acquisition import Signal, Slot, StreamInfo
from grabberd.errors import CaptureRunning, GrabberdError, NotReady
from grabberd.geometry import Calibration
from grabberd.service.armed import Armed
from grabberd.service.backlog import Backlog
from grabberd.service.capture_thread import Captures, CaptureThread
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.intake import Intake
from grabberd.service.recorder import CaptureRequest, Recorder
from grabberd.service.session import CaptureSession
from grabberd.service.setup import DeviceSetup, check_rig, settings_of
from grabberd.service.states import DeviceState
from grabberd.service.status import StatusBoard
from grabberd.service.worker import Worker
from grabberd.storage import CaptureMeta, CaptureWriter

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
        session: the running or the last capture.
    """

    def __init__(
        self,
        setup: DeviceSetup,
        clock: Clock,
        *,
        site: dict[str, str] | None = None,
        queue_s: float = 10.0,
        on_sealed: Callable[[CaptureSession], None] = lambda _: None,
    ) -> None:
        self.name = setup.name
        self.setup = setup
        self.board = StatusBoard(setup.name, clock)
        self.intake = Intake(setup.config)
        self.session: CaptureSession | None = None
        self._clock = clock
        self._site = site or {}
        self._queue_s = queue_s
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
    def running(self) -> CaptureSession | None:
        """The capture that is recording, or None."""
        session = self.session
        return session if session is not None and session.recorder.recording else None

    def start_capture(self, capture_id: str, request: CaptureRequest, part: Path) -> CaptureSession:
        """Attaches a recorder; fields are taken from this moment on, or from the ring for a pre-trigger.

        Raises:
            CaptureRunning: one is being recorded or sealed.
            NotReady: the device does not stream.
            CalibrationMismatch: the calibration is of pictures of another size than the stream's.
            StorageError: the file cannot be created.
        """
        with self._starting:
            self._check_free()
            armed = self._arm(request)
            try:
                session = self._attach(capture_id, request, armed, part)
            except GrabberdError:
                self.intake.thresholds.release()
                raise
            self.session = session
            session.start()
        return session

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

    def check_fits(self, calibration: Calibration) -> None:
        """Whether the pictures of this device may be measured with a calibration.

        Raises:
            CalibrationMismatch: it is of another rig, or of pictures of another size than the stream's.
        """
        check_rig(calibration, self.setup.config.rig)
        stream = self.board.now.stream
        if stream is not None:
            _check_stream(calibration, stream)

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

    def _check_free(self) -> None:
        self._check_no_capture()
        if not self.accepts:
            status = self.board.now
            cause = f" ({status.cause})" if status.cause else ""
            raise NotReady(
                f"device {self.name} is {status.state}{cause}",
                status.hint or "wait until its state is ready: GET /api/v1/state",
            )

    def _arm(self, request: CaptureRequest) -> Armed:
        """The ring for a capture; its threshold is chosen, where there is a picture, and held."""
        status, measuring = self.board.now, self.setup.measuring
        assert status.stream is not None
        if measuring is not None:
            _check_stream(measuring.calibration, status.stream)
        armed = self.intake.arm(request.bits, request.lines)
        if status.signal is not Signal.ABSENT:
            self.intake.thresholds.settle(armed)
        self.intake.thresholds.hold()
        return armed

    def _attach(self, capture_id: str, request: CaptureRequest, armed: Armed, part: Path) -> CaptureSession:
        stream, measuring = self.board.now.stream, self.setup.measuring
        assert stream is not None
        # The reader comes before the file, whose creation takes its time.
        reader = armed.ring.reader(request.overrun, back=request.pre_trigger_fields)
        writer = CaptureWriter.create(part, self._meta(capture_id, request, armed))
        backlog: Backlog[Slot] = Backlog(capacity=round(self._queue_s * stream.rate_hz))
        recorder = Recorder(
            request.fields,
            backlog,
            self._clock,
            round(1e9 / stream.rate_hz),
            lossless=stream.waits_for_reader,
            interruption=lambda: self.intake.interruption,
        )
        if measuring is not None:
            writer.begin_run(1, "live", iso_utc(self._clock.utc_now()), __version__, self.made_with)
        return CaptureSession(
            capture_id,
            recorder,
            reader,
            writer,
            backlog,
            self._clock,
            measured=measuring is not None,
            ends_when_interrupted=self._on_interruption(request) == "end",
            on_sealed=self._sealed,
        )

    def _meta(self, capture_id: str, request: CaptureRequest, armed: Armed) -> CaptureMeta:
        status = self.board.now
        assert status.stream is not None
        config = self.setup.config
        return CaptureMeta(
            id=capture_id,
            created_utc=iso_utc(self._clock.utc_now()),
            start_ns=self._clock.now_ns(),
            device={
                "name": self.name,
                "driver": config.driver,
                "options": config.options,
                "stream": asdict(status.stream),
            },
            config=config.model_dump(mode="json"),
            site=self._site,
            labels=request.labels,
            note=request.note,
            bits=armed.bits,
            lines=armed.lines,
            rate_hz=status.stream.rate_hz,
            version=__version__,
            extra={"on_interruption": self._on_interruption(request)},
        )

    def _on_interruption(self, request: CaptureRequest) -> str:
        return request.on_interruption or self.setup.config.capture.on_interruption

    @property
    def made_with(self) -> dict[str, Any]:
        """The documents that points are made with, as a run keeps them."""
        return {**self.setup.documents, "settings": settings_of(self.setup.config)}

    def _sealed(self, session: CaptureSession) -> None:
        self.intake.thresholds.release()
        self._on_sealed(session)


def _check_stream(calibration: Calibration, stream: StreamInfo) -> None:
    """Refuses pictures that are not the calibration's; a stream of doubled fields has all lines."""
    doubled = stream.field_rows == calibration.lines
    lines = stream.field_rows if doubled else 2 * stream.field_rows
    calibration.check_fits(stream.columns, lines, glass=calibration.glass)
