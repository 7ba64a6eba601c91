"""The captures of one device, and of all devices, and whether more may start."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from grabberd import runtime
from grabberd.archive.catalogue.disk_guard import DiskGuard, bytes_per_field
from grabberd.archive.measure_setups import misfit
from grabberd.config import RigConfig
from grabberd.core.field import FieldOrder
from grabberd.core.geometry import Calibration
from grabberd.errors import CaptureRunning, Conflict, GrabberdError, NotFound
from grabberd.instrument.acquisition import StreamInfo
from grabberd.instrument.capture.capture_request import ArmedCapture
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.status_board import STREAMING, StatusBoard
from grabberd.instrument.setup import DeviceSetup
from grabberd.runtime import UtcClock

T = TypeVar("T")


@dataclass(eq=False, slots=True)
class DeviceCaptures:
    """The captures of one device: at most one of them is armed or running.

    Attributes:
        setup: Configuration, grabber and calibration of the device; replaced between captures only.
        board: Status of the device.
        pipeline: Its ring and threshold.
        clock: Source of time.
        disk: Guard of the disk that captures are written to.
        site: The configuration's `site`, copied into every capture.
        queue_s: Seconds of fields that wait for a disk that stalls.
        on_sealed: Called with each recording once its file is closed.
        loggers: The data loggers, whose channels captures record.
        lock: Held while a capture is started, armed or disarmed, or while something it relies on is changed.
        recording: The running or the last capture, or None.
        starting: The capture whose fields are taken already, while its file is made; None before and after.
        armed: The capture that waits for its trigger, or None.
        ended: Number of captures that are sealed or given up, by verdict.
        measured: Number of those that were measured, by the verdict on how well.
    """

    setup: DeviceSetup
    board: StatusBoard
    pipeline: FieldPipeline
    clock: UtcClock
    disk: DiskGuard
    site: Mapping[str, str]
    queue_s: float
    on_sealed: Callable[[Recording], None]
    loggers: Loggers
    lock: runtime.Lock = field(init=False, default_factory=runtime.lock)
    recording: Recording | None = field(init=False, default=None)
    starting: Recording | None = field(init=False, default=None)
    armed: ArmedCapture | None = field(init=False, default=None)
    ended: Counter[str] = field(init=False, default_factory=Counter)
    measured: Counter[str] = field(init=False, default_factory=Counter)
    _counting: runtime.Lock = field(init=False, default_factory=runtime.lock)

    @property
    def name(self) -> str:
        """Name of the device."""
        return self.board.name

    @property
    def running(self) -> Recording | None:
        """The capture that is recording, or None."""
        recording = self.recording  # read once: another thread may begin the next capture meanwhile
        return recording if recording is not None and recording.recorder.recording else None

    @property
    def sealing(self) -> Recording | None:
        """The capture that is recorded, and still being measured and stored, or None."""
        recording = self.recording
        if recording is None or recording.recorder.recording or recording.sealed.is_set():
            return None
        return recording

    @property
    def is_recording(self) -> bool:
        """True if a capture is recording."""
        return self.running is not None

    @property
    def has_room(self) -> bool:
        """True if a source that waits for its reader may deliver another field."""
        running = self.running
        return running is not None and running.has_room

    def interrupted(self, error: GrabberdError) -> None:
        """Notifies the running capture that the device fails to deliver."""
        if (running := self.running) is not None:
            running.interrupted(error)

    def source_ended(self, error: GrabberdError) -> None:
        """Ends the running capture: its source has ended, or delivers different pictures than before."""
        if (running := self.running) is not None:
            running.source_ended(error)

    def sealed(self, recording: Recording) -> None:
        """Counts a recording whose file is sealed, and releases the threshold held for it."""
        # Before the recording counts as sealed: from then on the next capture may hold the threshold.
        self.pipeline.thresholds.release()
        if recording.seal_failure is None:
            self.count(recording)  # otherwise its verdict is that of a later, successful seal
        self.on_sealed(recording)

    def count(self, recording: Recording) -> None:
        """Counts a capture by its final verdict."""
        with self._counting:  # a capture that is sealed later is counted by another thread
            self.ended[recording.verdict] += 1
            if (measured := recording.coverage_verdict) is not None:
                self.measured[measured] += 1

    @property
    def accepts(self) -> bool:
        """True if a capture could be started if none were running."""
        status = self.board.now
        return status.state in STREAMING and status.stream is not None

    @property
    def stream(self) -> StreamInfo:
        """The stream that the driver granted; only for a device that accepts captures."""
        stream = self.board.now.stream
        assert stream is not None
        return stream

    @property
    def bytes_per_s(self) -> float:
        """Bytes that a capture writes per second: as measured on the running one, else as expected."""
        running = self.running
        per_field = (running and running.bytes_per_field) or self._expected_bytes_per_field
        return self.pipeline.rate_hz * per_field

    @property
    def _expected_bytes_per_field(self) -> float:
        rig, ring = self.setup.config.rig, self.pipeline.ring
        whole = ring.lines == "doubled" or self.pipeline.is_progressive
        rows = rig.lines if whole else rig.lines // 2
        return bytes_per_field(ring.bits, rows, rig.columns)

    def check_no_capture(self) -> None:
        """Checks that no capture exists.

        Raises:
            CaptureRunning: One is armed, or being recorded, measured or sealed.
        """
        if self.recording is not None and not self.recording.sealed.is_set():
            raise CaptureRunning(self.recording.id)
        if self.armed is not None:
            raise CaptureRunning(self.armed.id)

    def check_armed(self, capture_id: str) -> None:
        """Checks that this capture is the armed one.

        Raises:
            Conflict: It is not.
        """
        if self.armed is None or self.armed.id != capture_id:
            raise Conflict(f"capture {capture_id} is not armed", "it was triggered or has ended already")

    def disarm(self, capture_id: str) -> None:
        """Discards an armed capture.

        Raises:
            Conflict: It is not armed.
        """
        with self.lock:
            self.check_armed(capture_id)
            self.armed = None
            self.pipeline.thresholds.release()

    def check_measurable(self) -> None:
        """Checks that rig and calibration fit the size of the pictures that stream now, if any do.

        Raises:
            InputError: The rig does not fit.
            CalibrationMismatch: The calibration does not.
        """
        stream, measuring = self.board.now.stream, self.setup.measuring
        if stream is None:
            return
        if measuring is not None:
            check_stream(measuring.calibration, stream)
        check_picture_size(self.setup.config.rig, stream)


@dataclass(frozen=True, slots=True)
class CurrentCaptures:
    """The captures of all devices that have not been sealed yet.

    Attributes:
        devices: The captures of each device, by its name.
    """

    devices: Mapping[str, DeviceCaptures]

    def armed(self, group_id: str | None = None) -> list[ArmedCapture]:
        """The armed captures, of one group or all of them."""
        armed = [one.armed for one in self.devices.values() if one.armed is not None]
        return [one for one in armed if group_id is None or (one.group and one.group.id == group_id)]

    def recordings(self, group_id: str | None = None) -> list[Recording]:
        """The captures that are being recorded or sealed, or could not be sealed, of one group or all."""
        found = [one.recording for one in self.devices.values()]
        unsealed = [one for one in found if one is not None and not one.is_sealed]
        return [one for one in unsealed if group_id is None or (one.group and one.group.id == group_id)]

    def of_group(self, group_id: str) -> tuple[list[ArmedCapture], list[Recording]]:
        """The armed captures of a group, and those that are being recorded or sealed.

        A group that is just being armed, triggered or started is waited for: half of it must not be
        triggered or stopped alone.
        """
        groups = [one.group for one in self.armed(group_id)]
        groups += [one.group for one in self.recordings(group_id)]
        with locked(self.devices[name] for group in groups if group for name in group.devices):
            return self.armed(group_id), self.recordings(group_id)

    @property
    def bytes_per_s(self) -> float:
        """Bytes per second that the running captures write together."""
        return sum(one.bytes_per_s for one in self.devices.values() if one.is_recording)


@contextmanager
def locked(devices: Iterable[DeviceCaptures]) -> Iterator[None]:
    """Holds the locks of devices."""
    with ExitStack() as stack:
        # Always in the order of the names: otherwise two groups that share devices could deadlock.
        for one in sorted(set(devices), key=lambda one: one.name):
            stack.enter_context(one.lock)
        yield


def of_device(by_name: Mapping[str, T], name: str | None) -> T:
    """Looks up a device by its name, which may be omitted if there is only one.

    Raises:
        NotFound: No device has that name, or the name is needed.
    """
    if name is None and len(by_name) == 1:
        return next(iter(by_name.values()))
    if name is None or name not in by_name:
        message = "no device is named" if name is None else f"no device {name!r}"
        raise NotFound(message, f"name one of: {', '.join(by_name)}")
    return by_name[name]


def check_picture_size(rig: RigConfig, stream: StreamInfo) -> None:
    """Checks that the pictures of a stream have the rig's size, so that its views are where it says.

    Raises:
        InputError: They have another.
    """
    lines = _frame_lines(stream, rig.lines)
    if (stream.columns, lines) != (rig.columns, rig.lines):
        raise misfit(rig, stream.columns, lines)


def _frame_lines(stream: StreamInfo, expected: int) -> int:
    """Lines of a stream's frames: twice those of a field, unless they are doubled or progressive."""
    whole = stream.field_order is FieldOrder.PROGRESSIVE or stream.field_rows == expected
    return stream.field_rows if whole else 2 * stream.field_rows


def check_stream(calibration: Calibration, stream: StreamInfo) -> None:
    """Checks that the pictures of a stream have the calibration's size; doubled fields have all lines.

    Raises:
        CalibrationMismatch: They have another size.
    """
    lines = _frame_lines(stream, calibration.lines)
    calibration.check_fits(stream.columns, lines, glass=calibration.glass)
