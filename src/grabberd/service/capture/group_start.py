"""Starting captures on one or several devices: all of them at the same moment, or none.

A single capture is a group of one and takes the same steps.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from grabberd.acquisition.clock import Moment, UtcClock, iso_utc
from grabberd.errors import GrabberdError, GroupRefused
from grabberd.service.capture.capture_request import ArmedCapture
from grabberd.service.capture.capture_start import CaptureStart
from grabberd.service.capture.device_captures import CurrentCaptures
from grabberd.service.capture.disk_guard import DiskGuard


@dataclass(frozen=True, slots=True)
class DiskRoom:
    """Room on the disk that captures are written to, beside what running ones write there.

    Attributes:
        guard: Knows how much of the disk is free.
        folder: Folder of the captures.
        current: The captures that are running.
    """

    guard: DiskGuard
    folder: Path
    current: CurrentCaptures

    def check(self, starts: Sequence[CaptureStart]) -> None:
        """Checks that captures fit.

        Raises:
            StorageError: The disk has no room for all of them.
        """
        bytes_per_s = sum(one.device.bytes_per_s for one in starts)
        lengths_s = [one.duration_s for one in starts]
        longest_s = None if None in lengths_s else max(length or 0.0 for length in lengths_s)
        self.guard.check_fits(self.folder, bytes_per_s + self.current.bytes_per_s, longest_s)


def start(starts: Sequence[CaptureStart], room: DiskRoom, clock: UtcClock) -> None:
    """Starts captures; fields are taken from this moment on, or from the ring for a pre-trigger.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch: See `CaptureStart.check_free`.
        StorageError: A file cannot be created, or the disk has no room for all of them.
        GroupRefused: Some of several cannot start, so none does.
    """
    with _locks_of(starts):
        _each(starts, CaptureStart.check_free)
        try:
            _each(starts, CaptureStart.configure_ring)
            _begin(starts, room, clock)
        except GrabberdError:
            _release(starts)
            raise


def arm(starts: Sequence[CaptureStart], clock: UtcClock) -> list[ArmedCapture]:
    """Arms captures: their rings are configured, and stay so until they are triggered or disarmed.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch, GroupRefused: As `start`.
    """
    with _locks_of(starts):
        _each(starts, CaptureStart.check_free)
        try:
            _each(starts, CaptureStart.configure_ring)
        except GrabberdError:
            _release(starts)
            raise
        armed_utc = iso_utc(clock.utc_now())
        return [one.arm(armed_utc) for one in starts]


def trigger(starts: Sequence[CaptureStart], room: DiskRoom, clock: UtcClock) -> None:
    """Starts armed captures, with as many fields from before the trigger as they want and the ring has.

    Raises:
        Conflict: One is not armed.
        NotReady, CalibrationMismatch, StorageError, GroupRefused: As `start`; they stay armed.
    """
    with _locks_of(starts):
        # Asked again under the locks: another request may have triggered or stopped one meanwhile.
        _each(starts, CaptureStart.check_armed)
        _each(starts, CaptureStart.check_streams)
        _begin(starts, room, clock)


@contextmanager
def _locks_of(starts: Sequence[CaptureStart]) -> Iterator[None]:
    """Holds the locks of all devices."""
    with ExitStack() as stack:
        # Always in the order of the names: two groups that share devices would else wait for each other.
        for one in sorted(starts, key=lambda one: one.device.name):
            stack.enter_context(one.device.lock)
        yield


def _release(starts: Sequence[CaptureStart]) -> None:
    """Frees the thresholds of all: also a device whose own ring was configured without an error."""
    for one in starts:
        one.release()


def _begin(starts: Sequence[CaptureStart], room: DiskRoom, clock: UtcClock) -> None:
    room.check(starts)
    moment = Moment.now(clock)
    # All record before the first file is made: making one may take longer than the ring lasts (0.64 s).
    for one in starts:
        one.record()
    try:
        _each(starts, lambda one: one.make_file(moment))
    except GrabberdError:
        for one in starts:
            one.discard()
        raise
    # No capture is the device's before all files are there: until here everything can be undone.
    for one in starts:
        one.begin()


def _each(starts: Sequence[CaptureStart], step: Callable[[CaptureStart], None]) -> None:
    """Takes a step for all at the same time, so that one that takes long delays no other.

    Raises:
        GrabberdError: A single capture fails; GroupRefused: some of several fail.
    """

    def attempt(one: CaptureStart) -> GrabberdError | None:
        try:
            step(one)
        except GrabberdError as error:
            return error
        return None

    if len(starts) == 1:
        step(starts[0])
        return
    with ThreadPoolExecutor(len(starts), "capture-start") as pool:
        errors = list(pool.map(attempt, starts))
    refusals = {one.device.name: error for one, error in zip(starts, errors, strict=True) if error}
    if refusals:
        raise GroupRefused(refusals)
