"""One running capture: its recorder, its writer, and what the worker takes from both."""

import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from grabberd.acquisition import Outcome, RingReader, Slot
from grabberd.errors import DeviceLost, GrabberdError, StorageError, StreamEnded
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField
from grabberd.service.capture.backlog import Backlog
from grabberd.service.capture.capture_group import Group
from grabberd.service.capture.recorder import Recorder
from grabberd.service.capture.writer_thread import WriterThread
from grabberd.service.clock import Clock
from grabberd.storage import CaptureReader, CaptureWriter
from grabberd.storage.capture.schema import PART, RESERVE_BYTES

ROOM_SLOTS = 8
"""A source that waits for its reader is held back while fewer slots than this are free."""
ENOUGH_FIELDS = 100
"""So many fields say what one of them takes."""


class Recording:
    """A capture from its first field to its sealed file.

    Attributes:
        id: of the capture; `group`: that it belongs to, or None.
        recorder: the fields and their ledger.
        writing: the file and its points.
        sealed: set when the file has been closed for good, or given up, and `on_sealed` has been told.
        failure: what kept the capture from being written whole, or None.
    """

    def __init__(  # noqa: PLR0913 - it is put together from its parts
        self,
        capture_id: str,
        recorder: Recorder,
        reader: RingReader,
        writer: CaptureWriter,
        backlog: Backlog[Slot],
        clock: Clock,
        *,
        measured: bool,
        group: Group | None = None,
        ends_when_interrupted: bool = False,
        shortage: Callable[[Path], StorageError | None] = lambda _: None,
        on_sealed: Callable[["Recording"], None],
    ) -> None:
        self.id = capture_id
        self.group = group
        self.recorder = recorder
        self.sealed = threading.Event()
        self.writing = WriterThread(writer, backlog, clock, self._storage_failed, self._watch_disk)
        self.measuring_failure: str | None = None
        self._findings: Mapping[str, Any] | None = None
        self.measured = measured
        self._reader = reader
        self._writer = writer
        self._backlog = backlog
        self._ends_when_interrupted = ends_when_interrupted
        self._shortage = shortage
        self._on_sealed = on_sealed
        self._cut_by: GrabberdError | None = None
        if not measured:
            self.writing.measuring_ended()

    def start(self) -> None:
        """Starts writing, and recording if that has not begun before, each in a thread of its own."""
        self.recorder.start(self._reader, self.id)
        threading.Thread(target=self._write, name=f"writer-{self.id}", daemon=True).start()

    def stop(self, because: str) -> None:
        """Ends the recording; returns at once, `sealed` says when the file is closed."""
        self.recorder.stop(because)

    def discard(self) -> None:
        """It is not to begin after all: nothing is left of its file."""
        self._writer.discard()

    @property
    def path(self) -> Path:
        """The file as it is called now."""
        return self._writer.path

    def interrupted(self, error: GrabberdError) -> None:
        """The device fails to deliver: the capture goes on with the gap in its ledger, or is cut short."""
        if self._ends_when_interrupted:
            self.source_ended(DeviceLost(f"interrupted: {error.message}", error.hint))

    def source_ended(self, error: GrabberdError) -> None:
        """A recording came to its end; or to a picture that cannot be read, or the device delivers other
        pictures than before: then the capture is cut short.
        """
        if not isinstance(error, StreamEnded):
            self._cut_by = error
        self.stop(error.message)

    @property
    def is_sealed(self) -> bool:
        """Whether the file is closed under its final name; one that was given up is not."""
        return self.sealed.is_set() and self.path.suffix != PART

    @property
    def bytes_per_field(self) -> float | None:
        """What a field takes in the file, its points included; None until there are enough to tell."""
        written = self.writing.committed
        if written < ENOUGH_FIELDS or not self.path.exists():
            return None
        return (self.path.stat().st_size - RESERVE_BYTES) / written

    @property
    def failure(self) -> GrabberdError | None:
        """What kept the capture from being whole, or None."""
        return self.writing.failure or self._cut_by

    @property
    def complete(self) -> bool:
        """Whether every field that should have come is in the file, whole."""
        return self.recorder.ledger.complete and self.failure is None

    @property
    def verdict(self) -> str:
        """The same in a word."""
        return "complete" if self.complete else "incomplete"

    @property
    def has_room(self) -> bool:
        """Whether a source that waits for its reader may deliver another field."""
        in_ring = self._reader.waiting
        return self.recorder.recording and in_ring < ROOM_SLOTS and self._backlog.room > ROOM_SLOTS

    @property
    def deepest_ring(self) -> int:
        """The most slots of the ring that ever waited for the recorder."""
        return self._reader.deepest

    @property
    def deepest_backlog(self) -> int:
        """The most fields that ever waited for the writer."""
        return self._backlog.deepest

    def recorded(self) -> Iterator[NumberedField]:
        """Every good field in order, from memory or, where that has moved on, from the file."""
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
        """Takes one field's points, in order."""
        self.writing.add(measured)

    def measuring_ended(self, failure: str | None = None, findings: Mapping[str, Any] | None = None) -> None:
        """The worker has measured the last field, or cannot go on; `findings` go into the meta data."""
        self.measuring_failure = failure
        self._findings = findings
        self.writing.measuring_ended()

    def _past_end(self, index: int) -> bool:
        return self.writing.failure is not None or (self._backlog.closed and index >= self._backlog.end)

    def _from_file(self, first_n: int, end_n: int) -> Iterator[NumberedField]:
        with CaptureReader(self._writer.path) as reader:
            yield from reader.received(first_n, end_n)

    def _watch_disk(self) -> None:
        """Ends the recording while there is still room for what waits and for the seal."""
        error = self._shortage(self.path.parent) if self.recorder.recording else None
        if error is not None:
            self.source_ended(error)

    def _storage_failed(self, error: StorageError) -> None:
        self.stop("storage failed")

    def _write(self) -> None:
        try:
            self.writing.run()
            self._seal()
        except StorageError as error:
            self.writing.failure = error
            self._writer.close()
        finally:
            self.recorder.stop("storage failed")
            self._on_sealed(self)
            self.sealed.set()

    @property
    def _cut_off(self) -> str | None:
        """Why points are missing of fields that were written."""
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
