"""Rejected calibrations: read and not accepted; they stay as they are, and stay in the list."""

import threading

from grabberd.documents.calibrations import CalibrationRejection
from grabberd.service.clock import Clock, iso_utc
from grabberd.storage.state.state_store import StateStore

KEY = "rejected_calibrations"


class Rejections:
    """Kept in the state, beside the choice of the active calibration; any thread may ask."""

    def __init__(self, state: StateStore, clock: Clock) -> None:
        self._state = state
        self._clock = clock
        self._lock = threading.Lock()

    def all(self) -> dict[str, CalibrationRejection]:
        """By the calibrations' ids.

        Raises:
            StorageError: the state cannot be read.
        """
        return {key: CalibrationRejection(**value) for key, value in (self._state.get(KEY) or {}).items()}

    def add(self, calibration_id: str, note: str) -> None:
        """Rejects one; a note given before is replaced.

        Raises:
            StorageError: the state cannot be written.
        """
        with self._lock:
            rejection = CalibrationRejection(rejected_utc=iso_utc(self._clock.utc_now()), note=note)
            self._write({**self.all(), calibration_id: rejection})

    def lift(self, calibration_id: str) -> None:
        """Forgets that it was rejected, if it was.

        Raises:
            StorageError: the state cannot be written.
        """
        with self._lock:
            left = self.all()
            if left.pop(calibration_id, None):
                self._write(left)

    def _write(self, rejections: dict[str, CalibrationRejection]) -> None:
        self._state.put({KEY: {key: one.model_dump() for key, one in rejections.items()}})
