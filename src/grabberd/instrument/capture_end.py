"""The steps after the end of a capture: it is counted, entered in the index, and announced.

If its file could not be sealed, that is retried until it succeeds.
"""

import logging
from collections.abc import Callable, Mapping

from grabberd import runtime
from grabberd.archive.catalogue.archive import Archive
from grabberd.errors import CaptureFileError, Cause, GrabberdError, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.files.disk import storage_errors
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.instrument import Instrument
from grabberd.runtime import UtcClock

log = logging.getLogger(__name__)


class CaptureEnd:
    """Handles captures that have ended, in the threads that sealed them.

    Args:
        archive: The captures on disk.
        instruments: The instruments, by the name of their device.
        sealed: Called with the id and the device of each capture that is sealed.
        faults: Where captures that cannot be sealed are reported.
        clock: Source of time.

    Attributes:
        unsealed: The captures that could not be sealed yet.
    """

    def __init__(
        self,
        archive: Archive,
        instruments: Mapping[str, Instrument],
        sealed: Callable[[str, str], None],
        faults: FaultBoard,
        clock: UtcClock,
    ) -> None:
        self._archive = archive
        self._instruments = instruments
        self._sealed = sealed
        self.unsealed = UnsealedCaptures(archive.check, self._sealed_after_all, self._count, faults, clock)

    def ended(self, recording: Recording) -> None:
        """Handles a capture whose recording is over, sealed or not."""
        if recording.seal_failure is None:
            self._enter_in_index(recording)
        else:
            self.unsealed.add(recording)
        if recording.failure is not None:
            log.error("capture %s: %s; %s", recording.id, recording.failure.message, recording.failure.hint)
        received = recording.recorder.ledger.in_words(recording.recorder.rate_hz)
        log.info("capture %s has ended, %s; received: %s", recording.id, recording.verdict, received)

    def _sealed_after_all(self, recording: Recording) -> None:
        self._count(recording)
        self._enter_in_index(recording)
        log.info("capture %s is sealed now, %s", recording.id, recording.verdict)

    def _count(self, recording: Recording) -> None:
        self._instruments[_device_of(recording)].captures.count(recording)

    def _enter_in_index(self, recording: Recording) -> None:
        # The capture has ended even if the index cannot be written; it is entered later.
        try:
            with storage_errors(recording.path):
                self._archive.index.add(recording.path)
        except StorageError as error:
            log.error("capture %s is not in the index: %s; %s", recording.id, error.message, error.hint)
        self._sealed(recording.id, _device_of(recording))


def _device_of(recording: Recording) -> str:
    return str(recording.meta.device["name"])


FIRST_NS, LONGEST_NS = 2 * 10**9, 60 * 10**9
"""Time until the first further attempt, which doubles from one to the next, and its limit."""


class UnsealedCaptures:
    """Retries sealing captures; reports a fault once, and counts attempts.

    Args:
        check: Raises StorageError while the folder of captures is gone.
        sealed: Called with each capture once it is sealed.
        given_up: Called with each one whose file is gone or damaged.
        faults: Where it is reported.
        clock: Source of time.

    Attributes:
        captures: The captures, in the order in which they ended.
        attempts: Number of attempts that have failed since the start.
    """

    def __init__(
        self,
        check: Callable[[], None],
        sealed: Callable[[Recording], None],
        given_up: Callable[[Recording], None],
        faults: FaultBoard,
        clock: UtcClock,
    ) -> None:
        self.captures: tuple[Recording, ...] = ()
        self.attempts = 0
        self._check = check
        self._sealed = sealed
        self._given_up = given_up
        self._faults = faults
        self._clock = clock
        self._lock = runtime.lock()
        self._pause_ns = FIRST_NS
        self._due_ns = 0

    def add(self, recording: Recording) -> None:
        """Takes in a capture whose first attempt has just failed."""
        with self._lock:
            self.captures = (*self.captures, recording)
            self.attempts += 1
            self._pause_ns = FIRST_NS
            self._due_ns = self._clock.now_ns() + FIRST_NS
        self._report(recording.failure)

    def retry(self) -> None:
        """Retries all of them, if it is time to."""
        if not self.captures or self._clock.now_ns() < self._due_ns:
            return
        try:
            self._check()
        except StorageError:
            return  # reported already; sealed as soon as the folder is back
        failures = [failure for one in self.captures if (failure := self._try(one)) is not None]
        with self._lock:
            self._pause_ns = min(2 * self._pause_ns, LONGEST_NS)
            self._due_ns = self._clock.now_ns() + self._pause_ns
        if not self.captures:
            self._faults.resolve(Cause.CAPTURE_UNSEALED)
        elif failures:
            self._report(failures[0])

    def _try(self, recording: Recording) -> GrabberdError | None:
        try:
            recording.seal_again()
        except CaptureFileError as error:
            log.error("capture %s is given up: %s; %s", recording.id, error.message, error.hint)
            self._given_up(recording)
            self._drop(recording)
            return None
        except StorageError as error:
            self.attempts += 1
            return error
        self._sealed(recording)
        self._drop(recording)
        return None

    def _drop(self, recording: Recording) -> None:
        with self._lock:
            self.captures = tuple(one for one in self.captures if one is not recording)

    def _report(self, failure: GrabberdError | None) -> None:
        names = ", ".join(one.id for one in self.captures)
        why, hint = (failure.message, failure.hint) if failure else ("its file was closed", "wait")
        self._faults.report(
            Cause.CAPTURE_UNSEALED,
            f"not sealed yet: {names} ({why}); {self.attempts} attempts have failed",
            f"{hint}; it is retried automatically",
        )
