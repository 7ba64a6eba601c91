"""Captures that have ended and whose files could not be sealed: tried again until they are."""

import logging
import threading
from collections.abc import Callable

from grabberd.clock import UtcClock
from grabberd.errors import CaptureFileError, Cause, GrabberdError, StorageError
from grabberd.fault_board import FaultBoard
from grabberd.instrument.capture.recording import Recording

log = logging.getLogger(__name__)

FIRST_NS, LONGEST_NS = 2 * 10**9, 60 * 10**9
"""Time until the first further attempt, which doubles from one to the next, and its limit."""


class UnsealedCaptures:
    """Tries again to seal captures; told once as a fault, and counted.

    Args:
        check: Raises StorageError while the folder of captures is gone.
        sealed: Called with each capture once it is sealed.
        given_up: Called with each one whose file is gone or damaged.
        faults: Where it is told.
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
        self._lock = threading.Lock()
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
        """Tries all of them again, if it is time to."""
        if not self.captures or self._clock.now_ns() < self._due_ns:
            return
        try:
            self._check()
        except StorageError:
            return  # told already; sealed as soon as the folder is back
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
