"""The steps that follow the end of a capture: it is counted, entered in the index, and told of."""

import logging
from collections.abc import Callable, Mapping

from grabberd.archive.catalogue.archive import Archive
from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.instrument import Instrument

log = logging.getLogger(__name__)


class CaptureEnd:
    """Takes note of captures that have ended, in the threads that sealed them.

    Args:
        archive: The captures on disk.
        instruments: The instruments, by the name of their device.

    Attributes:
        unsealed: Called with a capture that could not be sealed.
        told: Called with the id and the device of one that is sealed.
    """

    def __init__(self, archive: Archive, instruments: Mapping[str, Instrument]) -> None:
        self._archive = archive
        self._instruments = instruments
        self.unsealed: Callable[[Recording], None] = lambda _: None
        self.told: Callable[[str, str], None] = lambda capture_id, device: None

    def ended(self, recording: Recording) -> None:
        """Takes note of a capture whose recording is over, sealed or not."""
        if recording.seal_failure is None:
            self._enter_in_index(recording)
        else:
            self.unsealed(recording)
        if recording.failure is not None:
            log.error("capture %s: %s; %s", recording.id, recording.failure.message, recording.failure.hint)
        received = recording.recorder.ledger.in_words(recording.recorder.rate_hz)
        log.info("capture %s has ended, %s; received: %s", recording.id, recording.verdict, received)

    def sealed_after_all(self, recording: Recording) -> None:
        """Takes note of a capture that could be sealed later."""
        self.count(recording)
        self._enter_in_index(recording)
        log.info("capture %s is sealed now, %s", recording.id, recording.verdict)

    def count(self, recording: Recording) -> None:
        """Counts a capture among those of its device."""
        self._instruments[_device_of(recording)].captures.count(recording)

    def _enter_in_index(self, recording: Recording) -> None:
        # The capture has ended all the same if the index cannot be written; it is entered later.
        try:
            with storage_errors(recording.path):
                self._archive.index.add(recording.path)
        except StorageError as error:
            log.error("capture %s is not in the index: %s; %s", recording.id, error.message, error.hint)
        self.told(recording.id, _device_of(recording))


def _device_of(recording: Recording) -> str:
    return str(recording.meta.device["name"])
