"""One capture: a recorder that drains the ring, a writer that writes, and what the worker takes from both."""

import logging
import queue
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from grabberd.acquisition import Ledger, LedgerEntry, Outcome, RingReader, Slot
from grabberd.errors import GrabberdError, StorageError
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField
from grabberd.service.backlog import Backlog
from grabberd.service.clock import Clock
from grabberd.storage import CaptureReader, CaptureWriter

log = logging.getLogger(__name__)

COMMIT_EVERY_NS = 500_000_000
GRACE_NS = 1_000_000_000
"""How long after its due end a capture of given length waits for fields that do not come."""


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """What is asked for; a capture ends after `fields` nominal field times, or when it is stopped.

    Attributes:
        fields: length in fields, lost ones included; None: until stopped.
        bits: bits a pixel; None: as the ring is armed.
        lines: "doubled" or "field"; None: doubled at 1 bit, field otherwise.
        pre_trigger_fields: how many fields before the request belong to it, as far as the ring has them.
        note: for people; `labels`: cow, teat, liner, …
    """

    fields: int | None = None
    bits: int | None = None
    lines: str | None = None
    pre_trigger_fields: int = 0
    note: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)


class CaptureSession:
    """A running capture; `ended` is set when its file is sealed, or given up."""

    def __init__(
        self,
        capture_id: str,
        request: CaptureRequest,
        reader: RingReader,
        writer: CaptureWriter,
        clock: Clock,
        *,
        rate_hz: float,
        capacity: int,
        measured: bool,
    ) -> None:
        self.id = capture_id
        self.request = request
        self.ledger = Ledger()
        self.backlog: Backlog[Slot] = Backlog(capacity)
        self.ended = threading.Event()
        self.ended_because: str | None = None
        self.failure: GrabberdError | None = None
        self.points = 0
        self._reader = reader
        self._writer = writer
        self._clock = clock
        self._period_ns = round(1e9 / rate_hz)
        self._started_ns = clock.now_ns()
        self._first_n: int | None = None
        self._results: queue.SimpleQueue[MeasuredField] = queue.SimpleQueue()
        self._all_measured = threading.Event()
        if not measured:
            self._all_measured.set()
        self._pending: list[LedgerEntry] = []
        self._threads = [
            threading.Thread(target=self._record, name=f"recorder-{capture_id}", daemon=True),
            threading.Thread(target=self._write, name=f"writer-{capture_id}", daemon=True),
        ]

    def start(self) -> None:
        """Starts recording; the fields before the trigger are in the ring reader already."""
        for thread in self._threads:
            thread.start()

    def stop(self, because: str) -> None:
        """Ends the recording; returns at once, `ended` says when the file is sealed."""
        self.ended_because = self.ended_because or because

    @property
    def recording(self) -> bool:
        """Whether fields are still being taken."""
        return self.ended_because is None

    @property
    def has_room(self) -> bool:
        """Whether a source that waits for its reader may deliver another field."""
        return self.recording and self._reader.lag < 8 and self.backlog.room > 8

    # -- the recorder's thread ---------------------------------------------------------------------

    def _record(self) -> None:
        try:
            while self.recording:
                slot = self._reader.take(0.1)
                if slot is not None:
                    self._take(slot)
                elif self._overdue():
                    self._end_at_target("nothing came")
            self._drain_what_came()
        finally:
            self._reader.close()
            self.backlog.close()
            self._end_of_fields = self.backlog.end

    def _drain_what_came(self) -> None:
        """A stop keeps what is in the ring already, as far as it belongs to the capture."""
        while (slot := self._reader.take(0)) is not None and not self._reached(slot.n):
            self._enter(slot)

    def _take(self, slot: Slot) -> None:
        if self._reached(slot.n):
            self._end_at_target(slot.lost_before[-1].reason if slot.lost_before else "time gap")
        else:
            self._enter(slot)
            if self._reached(slot.n + 1):
                self.stop("length reached")

    def _reached(self, n: int) -> bool:
        """Whether the stream's field number n lies beyond the capture's length."""
        wanted = self.request.fields
        return wanted is not None and self._first_n is not None and n - self._first_n >= wanted

    def _end_at_target(self, reason: str) -> None:
        assert self.request.fields is not None
        self.ledger.close(self.request.fields, reason)
        self.stop("length reached")

    def _overdue(self) -> bool:
        if self.request.fields is None:
            return False
        due_ns = self._started_ns + self.request.fields * self._period_ns
        return self._clock.now_ns() > due_ns + GRACE_NS

    def _enter(self, slot: Slot) -> None:
        """Numbers a field from the capture's first one, enters it in the ledger and queues it for the writer."""
        if self._first_n is None:
            self._first_n = slot.n
            slot = slot._replace(lost_before=())
        slot = _rebased(slot, self._first_n)
        slot = slot._replace(lost_before=(*self._pending, *slot.lost_before))
        self._pending = []
        if self.backlog.append(slot):
            self._account(slot)
        else:
            overrun = LedgerEntry(slot.n, 1, Outcome.OVERRUN, "disk too slow")
            self._pending = [*slot.lost_before, overrun]

    def _account(self, slot: Slot) -> None:
        for entry in slot.lost_before:
            self.ledger.add(entry)
        if slot.outcome is Outcome.RECEIVED:
            self.ledger.receive(slot.n)
        else:
            self.ledger.add(LedgerEntry(slot.n, 1, slot.outcome, slot.reason or ""))

    # -- the worker's side -------------------------------------------------------------------------

    def recorded(self) -> Iterator[NumberedField]:
        """Every recorded field in order, from memory or, where that has moved on, from the file."""
        index = 0
        while True:
            try:
                slot = self.backlog.at(index, timeout_s=0.1)
            except LookupError:
                index = yield from self._from_file(index)
                continue
            if slot is None and self.backlog.closed and index >= self.backlog.end:
                return
            if slot is not None:
                index += 1
                if slot.numbered is not None and slot.outcome is Outcome.RECEIVED:
                    yield slot.numbered
