"""A running capture, from its first field to its sealed file."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from grabberd.acquisition import Outcome
from grabberd.acquisition.clock import UtcClock
from grabberd.errors import DeviceLost, GrabberdError, StorageError, StreamEnded
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField
from grabberd.service.capture.capture_request import NewCapture
from grabberd.service.capture.disk_guard import DiskGuard
from grabberd.service.capture.recorder import Recorder
from grabberd.service.capture.writer_thread import WriterThread
from grabberd.storage import CaptureMeta, CaptureReader, CaptureWriter, RunInfo
from grabberd.storage.capture.schema import PART, RESERVE_BYTES, sealed_path

ROOM_SLOTS = 8
"""A source that waits for its reader is held back when as many slots wait, or as few places are left."""
ENOUGH_FIELDS = 100
"""Number of fields from which on the size of the file tells that of a field."""


class Recording:
    """A capture that records, is measured, and is sealed when both are done.

    Args:
        new: The capture as it was started.
        recorder: Takes the fields; may have been started already.
        writer: The capture's file.
        clock: Source of time.
        measured: True if a worker measures the fields.
        ends_when_interrupted: True if the capture ends when the device fails to deliver.
        disk: Guard of the disk; None: the capture takes all there is.
        on_sealed: Called when the file has been closed for good, or given up.

    Attributes:
        id: Id of the capture.
        group: Group of the capture, or None.
        recorder: The fields and their ledger.
        writing: The file and its points.
        measured: True if a worker measures the fields.
        measuring_failure: Why measuring ended early, or None.
        sealed: Set when the file has been closed for good, or given up, and `on_sealed` has returned.
    """

    def __init__(
        self,
        new: NewCapture,
        recorder: Recorder,
        writer: CaptureWriter,
        clock: UtcClock,
        *,
        measured: bool,
        ends_when_interrupted: bool = False,
        disk: DiskGuard | None = None,
        on_sealed: Callable[["Recording"], None],
    ) -> None:
        self.id = new.id
        self.group = new.group
        self.recorder = recorder
        self.sealed = threading.Event()
        self.writing = WriterThread(writer, recorder.backlog, clock, self._storage_failed, self._watch_disk)
        self.measuring_failure: str | None = None
        self.measured = measured
        self._findings: Mapping[str, Any] | None = None
        self._writer = writer
        self._backlog = recorder.backlog
        self._ends_when_interrupted = ends_when_interrupted
        self._disk = disk
        self._on_sealed = on_sealed
        self._cut_by: GrabberdError | None = None
        # The writer ends only when its points have, too.
        if not measured:
            self.writing.measuring_ended()

    def start(self) -> None:
        """Starts writing, and recording if that has not begun before, each in a thread of its own."""
        self.recorder.start(self.id)
        threading.Thread(target=self._write, name=f"writer-{self.id}", daemon=True).start()

    def stop(self, because: str) -> None:
        """Ends the recording; returns at once, `sealed` is set when the file is closed."""
        self.recorder.stop(because)

    def discard(self) -> None:
        """Deletes the file of a capture that is not started after all."""
        self._writer.discard()

    @property
    def path(self) -> Path:
        """Present path of the file."""
        return self._writer.path

    @property
    def size_bytes(self) -> int:
        """Size of the file."""
        path = self.path
        try:
            return path.stat().st_size
        except FileNotFoundError:  # it is getting its final name at this moment
            return sealed_path(path).stat().st_size

    @property
    def meta(self) -> CaptureMeta:
        """Metadata of the capture, as it was started with them."""
        return self._writer.meta

    @property
    def runs(self) -> Sequence[RunInfo]:
        """Runs of the capture: the one that is measured while it records, if any."""
        return self._writer.runs

    @property
    def first_n(self) -> int:
        """The stream's number of the capture's first field; 0 before that came."""
        return self.recorder.first_n or 0

    def interrupted(self, error: GrabberdError) -> None:
        """Notes that the device fails to deliver: the capture goes on with a gap, or is cut short."""
        if self._ends_when_interrupted:
            self.source_ended(DeviceLost(f"interrupted: {error.message}", error.hint))

    def source_ended(self, error: GrabberdError) -> None:
        """Ends the recording because its source has ended.

        The end of a replayed recording is a good end. A picture that cannot be read, and a device that
        delivers another picture than before, cut the capture short.
        """
        if not isinstance(error, StreamEnded):
            self._cut_by = error
        self.stop(error.message)

    @property
    def is_sealed(self) -> bool:
        """True if the file is closed under its final name; a file that was given up is not."""
        return self.sealed.is_set() and self.path.suffix != PART

    @property
    def bytes_per_field(self) -> float | None:
        """Bytes per field in the file, points included; None until there are enough fields to tell."""
        written = self.writing.committed
        if written < ENOUGH_FIELDS or not self.path.exists():
            return None
        return (self.path.stat().st_size - RESERVE_BYTES) / written

    @property
    def failure(self) -> GrabberdError | None:
        """The error that kept the capture from being whole, or None."""
        return self.writing.failure or self._cut_by

    @property
    def complete(self) -> bool:
        """True if every field that should have come is in the file, whole."""
        return self.recorder.ledger.complete and self.failure is None

    @property
    def verdict(self) -> str:
        """One word, "complete" or "incomplete"."""
        return "complete" if self.complete else "incomplete"

    @property
    def has_room(self) -> bool:
        """True if a source that waits for its reader may deliver another field."""
        in_ring = self.recorder.reader.waiting
        return self.recorder.recording and in_ring < ROOM_SLOTS and self._backlog.room > ROOM_SLOTS

    def recorded(self) -> Iterator[NumberedField]:
        """Every good field in order: from memory, or from the file if memory has let go of it."""
        # The backlog counts slots, the file fields: a gap between two slots has numbers, but no index.
        index, next_n = 0, 0
        while not self._past_end(index):
            try:
                slot = self._backlog.at(index, timeout_s=0.1)
            except LookupError:
                index, oldest = self._backlog.oldest()
                yield from self._from_file(next_n, oldest.n)
                next_n = oldest.n
                continue
            if slot is not None:
                index, next_n = index + 1, slot.n + 1
                if slot.numbered is not None and slot.outcome is Outcome.RECEIVED:
                    yield slot.numbered

    def add(self, measured: MeasuredField) -> None:
        """Adds one field's points; fields come in order."""
        self.writing.add(measured)

    def measuring_ended(self, failure: str | None = None, findings: Mapping[str, Any] | None = None) -> None:
        """Notes that the worker has measured the last field, or cannot go on.

        Args:
            failure: Why it cannot go on, or None.
            findings: Entries for the metadata, or None.
        """
        self.measuring_failure = failure
        self._findings = findings
        self.writing.measuring_ended()

    def _past_end(self, index: int) -> bool:
        return self.writing.failure is not None or (self._backlog.closed and index >= self._backlog.end)

    def _from_file(self, first_n: int, end_n: int) -> Iterator[NumberedField]:
        with CaptureReader(self._writer.path) as reader:
            yield from reader.received(first_n, end_n)

    def _watch_disk(self) -> None:
        """Ends the recording while there is still room for the queued fields and for the seal."""
        if self._disk is None or not self.recorder.recording:
            return
        if (error := self._disk.shortage(self.path.parent)) is not None:
            self.source_ended(error)

    def _storage_failed(self, error: StorageError) -> None:
        self.stop("storage failed")

    def _write(self) -> None:
        try:
            self.writing.run()
            self._seal()
        except StorageError as error:
            self.writing.failure = error
            # Not sealed: the next start finds the .part file and seals what is in it.
            self._writer.close()
        finally:
            self.recorder.stop("storage failed")
            # The index and the counters are right by the time anybody who waits for `sealed` looks at them.
            self._on_sealed(self)
            self.sealed.set()

    @property
    def _cut_off(self) -> str | None:
        """Reason why points are missing for fields that were written."""
        failure = self.writing.failure
        return f"writing ended early: {failure.message}" if failure and self.measured else None

    def _seal(self) -> None:
        because = self.failure.message if self.failure else self.recorder.ended_because
        self._writer.seal(
            self.recorder.ledger,
            complete=self.complete,
            ended_because=because or "",
            measuring_failure=self.measuring_failure or self._cut_off,
            findings=self._findings,
        )
