"""One grabber made into an instrument: its threads, its ring and at most one capture."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd.config import DeviceConfig
from grabberd.errors import CalibrationMismatch, GrabberdError
from grabberd.geometry import Calibration
from grabberd.service.capture import group_start
from grabberd.service.capture.armed_capture import ArmedCapture
from grabberd.service.capture.capture_request import Planned
from grabberd.service.capture.capture_start import CaptureStart
from grabberd.service.capture.disk_guard import DiskGuard
from grabberd.service.capture.group_start import Member
from grabberd.service.capture.recorder import CaptureRequest
from grabberd.service.capture.recording import Recording
from grabberd.service.capture.recording_start import Attaching, ring_bytes_per_field
from grabberd.service.clock import Clock
from grabberd.service.device.capture_thread import Captures, CaptureThread
from grabberd.service.device.fair_lock import FairLock
from grabberd.service.device.field_pipeline import FieldPipeline
from grabberd.service.device.status_board import StatusBoard
from grabberd.service.device.worker import Worker
from grabberd.service.setup import DeviceSetup, check_rig, check_stream

NOMINAL_RATE_HZ = 50.0


class Instrument:
    """Streams and measures from start to stop; captures when asked.

    Attributes:
        name: of the device.
        setup: what it is made of; its calibration may be exchanged between captures.
        board: its status.
        intake: its ring and threshold.
        worker: its live points; it waits while there is no calibration or no object model.
        beginning: how its captures begin.
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
        on_sealed: Callable[[Recording], None] = lambda _: None,
        turns: FairLock | None = None,
    ) -> None:
        self.name = setup.name
        self.setup = setup
        self.board = StatusBoard(setup.name, clock)
        self.intake = FieldPipeline(setup.config)
        self.ended: Counter[str] = Counter()
        self._clock = clock
        self._disk = disk or DiskGuard()
        attaching = Attaching(self.intake, clock, self._disk, site or {}, queue_s, self._sealed)
        self.beginning = CaptureStart(self.board, attaching, lambda: self.setup)
        self._on_sealed = on_sealed
        self.worker = Worker(self.name, setup.measuring, self.intake, lambda: self.session, clock, turns)
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
    def session(self) -> Recording | None:
        """The running or the last capture."""
        return self.beginning.session

    @property
    def waiting(self) -> ArmedCapture | None:
        """The capture that is armed, or None."""
        return self.beginning.waiting

    @property
    def accepts(self) -> bool:
        """Whether a capture could be started, were none running."""
        return self.beginning.accepts

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
    def running(self) -> Recording | None:
        """The capture that is recording, or None."""
        session = self.session
        return session if session is not None and session.recorder.recording else None

    def start_capture(self, capture_id: str, request: CaptureRequest, part: Path) -> Recording:
        """Attaches a recorder; fields are taken from this moment on, or from the ring for a pre-trigger.

        Raises:
            CaptureRunning, NotReady, InputError, CalibrationMismatch, StorageError: see `group_start.start`.
        """

        def room(bytes_per_s: float, duration_s: float | None) -> None:
            self._disk.check_fits(part.parent, bytes_per_s, duration_s)

        member = Member(self.beginning, Planned(capture_id, request, part))
        group_start.start([member], room, self._clock)
        assert self.session is not None
        return self.session

    @contextmanager
    def between_captures(self) -> Iterator[None]:
        """Holds captures off, for what must not change while one is recorded and measured.

        Raises:
            CaptureRunning: one is being recorded, measured or sealed.
        """
        with self.beginning.lock:
            self.beginning.check_no_capture()
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
            self.beginning.check_measurable()
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

    @property
    def made_with(self) -> dict[str, Any]:
        """The documents that points are made with, as a run keeps them."""
        return self.setup.made_with

    def _sealed(self, session: Recording) -> None:
        self.intake.thresholds.release()
        self.ended[session.verdict] += 1
        self._on_sealed(session)
