"""A running capture, from its first field to its sealed file, and its document meanwhile."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from grabberd import runtime
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.capture.schema import PART, RESERVE_BYTES, sealed_path
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.capture_documents import document_of
from grabberd.archive.catalogue.disk_guard import DiskGuard
from grabberd.core.chain.measure import MeasuredField
from grabberd.core.channels.account import Account
from grabberd.core.field import NumberedField
from grabberd.core.ledger import Outcome
from grabberd.core.measurement.marks import Located
from grabberd.core.reconstruction import Coverage
from grabberd.core.reconstruction.coverage import coverage_document
from grabberd.documents.captures import CaptureDocument
from grabberd.errors import DeviceLost, GrabberdError, StorageError, StreamEnded
from grabberd.instrument.capture.capture_request import NewCapture
from grabberd.instrument.capture.recorder import Recorder
from grabberd.instrument.channels.feed import ChannelRecording
from grabberd.runtime import UtcClock

ROOM_SLOTS = 8
"""A source that waits for its reader is held back if so many slots wait, or so few places are left."""
ENOUGH_FIELDS = 100
"""Number of fields from which on the size of a field is derived from that of the file."""
COMMIT_EVERY_NS = 500_000_000
"""Limits what a kill loses (docs/decisions/archive.md); not shorter, since each commit waits for the disk."""
LIVE_RUN = 1
"""Number of the run that is measured during the recording."""
WAIT_S = 0.05
"""Longest wait for a slot or for points, and so the longest delay of a commit that becomes due meanwhile."""


class Recording:
    """A capture that records, is measured and written meanwhile, and is sealed when all are done.

    A separate thread writes slots from the backlog and points from the worker.

    Args:
        new: The capture as it was started.
        recorder: Takes the fields; may have been started already.
        writer: The capture's file.
        clock: Source of time.
        measured: True if a worker measures the fields.
        disk: Guard of the disk; None: the capture may fill it.
        channels: Channels recorded with the fields; None if there are none.
        on_sealed: Called when the file has been closed for good, or given up.

    Attributes:
        id: Id of the capture.
        group: Group of the capture, or None.
        recorder: The fields and their ledger.
        committed: Number of slots that are committed to the file.
        first_time_ns: Time of the first field that has been written; None before that.
        measured: True if a worker measures the fields.
        awaits_measuring: True until it has; as the last one of the device, a capture is measured once.
        measuring_failure: Why measuring ended early, or None.
        seal_failure: Why the file could not be sealed, or None.
        sealed: Set when the file has been closed for good, or given up, and `on_sealed` has returned.
    """

    def __init__(
        self,
        new: NewCapture,
        recorder: Recorder,
        clock: UtcClock,
        *,
        measured: bool,
        disk: DiskGuard | None = None,
        channels: ChannelRecording | None = None,
        on_sealed: Callable[["Recording"], None],
    ) -> None:
        self.id = new.id
        self.group = new.group
        self.recorder = recorder
        self.sealed = runtime.event()
        self.committed = 0
        self.first_time_ns: int | None = None
        self.measuring_failure: str | None = None
        self.measured = self.awaits_measuring = measured
        self._findings: Mapping[str, Any] | None = None
        self._coverage: Coverage | None = None
        self._backlog = recorder.backlog
        self._disk = disk
        self._channels = channels
        self._newest_ns = 0
        self._on_sealed = on_sealed
        self._clock = clock
        self._cut_by: GrabberdError | None = None
        self._storage_failure: StorageError | None = None
        self.seal_failure: StorageError | None = None
        # Unbounded: the worker must not wait for a stalled disk.
        self._results: runtime.Queue[MeasuredField | None] = runtime.simple_queue()
        self._all_measured = not measured
        self._appended = 0
        self._size_bytes = 0
        self._commit_due_ns = clock.now_ns() + COMMIT_EVERY_NS

    def write_to(self, writer: CaptureWriter) -> None:
        """Takes its file, before which its fields may already be measured."""
        self._writer = writer
        self._ends_when_interrupted = writer.meta.extra.get("on_interruption") == "end"

    def start(self) -> None:
        """Starts writing, and recording if that has not started yet, each in a separate thread."""
        self.recorder.start(self.id)
        runtime.Thread(target=self._write, name=f"writer-{self.id}", daemon=True).start()

    def stop(self, because: str) -> None:
        """Ends the recording; returns at once, `sealed` is set when the file is closed."""
        self.recorder.stop(because)

    def discard(self) -> None:
        """Deletes the file of a capture that is not started after all."""
        self._writer.discard()

    def seal_again(self) -> None:
        """Seals the file of a capture that was given up, with all known metadata.

        Raises:
            StorageError: It still cannot be sealed.
            CaptureFileError: The file is gone or damaged.
        """
        self._writer.reopen()
        failed, self.seal_failure = self.seal_failure, None
        try:
            self._seal()
        except StorageError:
            self.seal_failure = failed
            self._writer.close()
            raise

    @property
    def path(self) -> Path:
        """Current path of the file."""
        return self._writer.path

    @property
    def size_bytes(self) -> int:
        """Size of the file; its last known size if it is gone."""
        path = self.path
        for name in (path, sealed_path(path)):  # it may be getting its final name at this moment
            with contextlib.suppress(OSError):
                self._size_bytes = name.stat().st_size
                break
        return self._size_bytes

    @property
    def meta(self) -> CaptureMeta:
        """Metadata with which the capture was started."""
        return self._writer.meta

    @property
    def channels(self) -> Account | None:
        """Account of its channels so far; None if it has none."""
        return None if self._channels is None else self._channels.account

    @property
    def runs(self) -> Sequence[RunInfo]:
        """Runs of the capture: the one that is measured while it records, if any."""
        return self._writer.runs

    @property
    def document(self) -> CaptureDocument:
        """The document of the capture while it is recorded, measured or sealed; the file is not read."""
        document = document_of(
            self.meta,
            self.recorder.ledger,
            self.runs,
            fields=self.recorder.fields,
            first_time_ns=self.first_time_ns,
            size_bytes=self.size_bytes,
            account=self.channels,
        )
        ended = "unsealed" if self.sealed.is_set() and not self.is_sealed else "sealing"
        state = "recording" if self.recorder.recording else ended
        length = self.recorder.length_fields if state == "recording" else None
        changes = {"state": state, "length_fields": length, "ended_because": self.recorder.ended_because}
        return document.model_copy(update=changes)

    @property
    def first_n(self) -> int:
        """The stream's number of the capture's first field; 0 before that came."""
        return self.recorder.first_n or 0

    def interrupted(self, error: GrabberdError) -> None:
        """Notes that the device fails to deliver: the capture continues with a gap, or is cut short."""
        if self._ends_when_interrupted:
            self.source_ended(DeviceLost(f"interrupted: {error.message}", error.hint))

    def source_ended(self, error: GrabberdError) -> None:
        """Ends the recording because its source has ended.

        The end of a replayed recording is a regular end. An unreadable picture, or a device that delivers
        different pictures than before, cuts the capture short.
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
        if self.committed < ENOUGH_FIELDS:
            return None
        return (self.size_bytes - RESERVE_BYTES) / self.committed

    @property
    def failure(self) -> GrabberdError | None:
        """The error that made the capture incomplete, or None."""
        return self._storage_failure or self._cut_by or self.seal_failure

    @property
    def complete(self) -> bool:
        """True if every due field is in the file, undamaged."""
        return self.recorder.ledger.complete and self.failure is None

    @property
    def verdict(self) -> str:
        """One word, "complete" or "incomplete"."""
        return "complete" if self.complete else "incomplete"

    @property
    def coverage_verdict(self) -> str | None:
        """Verdict on how well its live run was measured; None if it was not counted."""
        covered = self._covered
        return covered[LIVE_RUN]["verdict"] if covered else None

    @property
    def has_room(self) -> bool:
        """True if a source that waits for its reader may deliver another field."""
        in_ring = self.recorder.reader.waiting
        return self.recorder.recording and in_ring < ROOM_SLOTS and self._backlog.room > ROOM_SLOTS

    def marks_before(self) -> Sequence[tuple[int, Located]]:
        """Parity and located marks of the fields before its first, once that has come."""
        return self.recorder.marks_before

    def recorded(self) -> Iterator[NumberedField]:
        """Every good field in order: from memory, or from the file if it was forgotten."""
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
        """Queues one field's points; called by the worker, in the order of the fields."""
        self._results.put(measured)

    def measuring_ended(
        self,
        failure: str | None = None,
        findings: Mapping[str, Any] | None = None,
        coverage: Coverage | None = None,
    ) -> None:
        """Notes that the worker has measured the last field, or cannot continue.

        Args:
            failure: Why it cannot continue, or None.
            findings: Entries for the metadata, or None.
            coverage: Coverage of the fields that it has measured, or None.
        """
        self.awaits_measuring = False
        self._coverage = coverage
        self.measuring_failure = failure
        self._findings = findings
        self._results.put(None)

    def _past_end(self, index: int) -> bool:
        return self._storage_failure is not None or (self._backlog.closed and index >= self._backlog.end)

    def _from_file(self, first_n: int, end_n: int) -> Iterator[NumberedField]:
        with CaptureReader(self._writer.path) as reader:
            yield from reader.received(first_n, end_n)

    def _watch_disk(self) -> None:
        """Ends the recording while there is room for the queued fields and the seal."""
        if self._disk is None or not self.recorder.recording:
            return
        if (error := self._disk.shortage(self.path.parent)) is not None:
            self.source_ended(error)

    def _write(self) -> None:
        try:
            self._write_all()
            self._seal()
            if self._storage_failure is None:  # otherwise the worker may still be reading
                self._backlog.drop()  # the device keeps its last recording until the next
        except StorageError as error:
            self.seal_failure = error
            # Not sealed: the .part file is tried again by `seal_again`, and by the next start at the latest.
            self._writer.close()
        finally:
            self.recorder.stop("storage failed")
            self._close_channels()
            # Index and counters are up to date before `sealed` is set.
            try:
                self._on_sealed(self)
            finally:
                self.sealed.set()  # in any case: the next capture must not wait for this one

    def _write_all(self) -> None:
        """Writes until everything recorded has been written and measured, or the disk fails."""
        try:
            while not (self._all_recorded and self._all_measured and self._has_all_readings):
                self._write_some()
            self._commit()
        except StorageError as error:
            # Noted, not raised: the file is sealed with its present content, if the disk allows it.
            self._storage_failure = error
            self.stop("storage failed")

    @property
    def _next_index(self) -> int:
        return self.committed + self._appended

    @property
    def _all_recorded(self) -> bool:
        return self._backlog.closed and self._next_index == self._backlog.end

    @property
    def _has_all_readings(self) -> bool:
        return self._channels is None or self._channels.has_all(self._newest_ns)

    def _write_some(self) -> None:
        if self._all_recorded:
            self._wait_for_points()
        else:
            self._append_slots()
        while not self._results.empty():
            self._append_points(self._results.get())
        self._append_readings()
        if self._clock.now_ns() >= self._commit_due_ns:
            self._commit()

    def _append_slots(self) -> None:
        slots = self._backlog.from_index(self._next_index, timeout_s=WAIT_S)
        if slots and not self._next_index:
            self._writer.remember_marks(self.recorder.marks_before)
        self._writer.append(slots)
        if self.first_time_ns is None:
            self.first_time_ns = next((one.numbered.time_ns for one in slots if one.numbered), None)
        if slots:
            self._newest_ns = slots[-1].time_ns
        self._appended += len(slots)

    def _append_readings(self) -> None:
        if self._channels is not None and self.first_time_ns is not None:
            self._channels.write(self._writer, self.first_time_ns, self._newest_ns)

    def _close_channels(self) -> None:
        if self._channels is not None:
            self._channels.close()

    def _wait_for_points(self) -> None:
        """Sleeps while the worker measures the last fields, to leave it the processor."""
        with contextlib.suppress(runtime.Empty):
            self._append_points(self._results.get(timeout=WAIT_S))

    def _append_points(self, measured: MeasuredField | None) -> None:
        if measured is None:
            self._all_measured = True
        else:
            self._writer.append_points(LIVE_RUN, measured.n, measured.points)

    def _commit(self) -> None:
        # From begin to begin: what comes during a slow commit must not wait for half a second after it.
        self._commit_due_ns = self._clock.now_ns() + COMMIT_EVERY_NS
        self._writer.commit()
        # Only now may the backlog forget them: forgotten fields must be readable from the file.
        self._backlog.written(self._appended)
        self.committed += self._appended
        self._appended = 0
        self._watch_disk()

    @property
    def _cut_off(self) -> str | None:
        """Reason why points are missing for fields that were written."""
        failure = self._storage_failure
        return f"writing ended early: {failure.message}" if failure and self.measured else None

    def _seal(self) -> None:
        because = self.failure.message if self.failure else self.recorder.ended_because
        self._writer.seal(
            self.recorder.ledger,
            complete=self.complete,
            ended_because=because or "",
            measuring_failure=self.measuring_failure or self._cut_off,
            findings=self._findings,
            coverage=self._covered,
        )

    @property
    def _covered(self) -> dict[int, dict[str, Any]] | None:
        """Coverage of the live run as a document, if it has been counted."""
        if self._coverage is None:
            return None
        missing = max(sum(self.recorder.ledger.counts().values()) - len(self._coverage.n), 0)
        return {LIVE_RUN: coverage_document(self._coverage, missing)}
