"""Recording: from the ring into the capture's own queue, from its first field to its last, with a ledger."""

import itertools
import math
from collections import deque
from collections.abc import Iterable
from typing import Generic, TypeVar

from grabberd import runtime
from grabberd.core.ledger import Ledger, LedgerEntry, Outcome, Slot
from grabberd.core.measurement.marks import Located
from grabberd.errors import RingOverrun
from grabberd.instrument.acquisition import RingReader, StreamInfo
from grabberd.instrument.capture.begin import Begin, NumbersFromBegin, number_at
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.runtime import UtcClock


def cut(entries: Iterable[LedgerEntry], first_n: int, end_n: float = math.inf) -> tuple[LedgerEntry, ...]:
    """The part of the entries with first_n ≤ n < end_n."""
    parts = []
    for entry in entries:
        first, end = max(entry.first_n, first_n), min(entry.end_n, end_n)
        if first < end:
            parts.append(entry._replace(first_n=first, count=int(end) - first))
    return tuple(parts)


T = TypeVar("T")
GRACE_NS = 1_000_000_000
"""Time after its due end that a capture of given length still waits for missing fields."""
SILENT_FIELDS = 5
"""Field times without a field after which the stream may have stalled."""
HEARINGS, HEARING_S = 12, 0.1
"""Number and length of the waits for an explanation when a recording ends without fields.

Together 1.2 s: longer than the capture thread takes to notice a stall (0.8 s) and to enter its reason.
"""
TAKE_S = 0.1
"""Longest wait for a slot; also how long a stop may go unnoticed while no fields come."""


class Backlog(Generic[T]):
    """An append-only list that forgets its head once it is on disk; indices count from the first item ever.

    If the writer falls behind by more than `capacity` items, `append` refuses. The measuring worker may fall
    behind without limit: it reads forgotten items from the file.

    Attributes:
        capacity: Number of items that the writer may fall behind.
        deepest: The most items that ever waited for the writer.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.deepest = 0
        self._items: deque[T] = deque()
        self._first = 0
        self._written = 0
        self._closed = False
        self._changed = runtime.condition()

    @property
    def end(self) -> int:
        """Index after the last item."""
        with self._changed:
            return self._end()

    @property
    def closed(self) -> bool:
        """True if nothing will be appended any more."""
        return self._closed

    def append(self, item: T) -> bool:
        """Appends an item; returns False, and appends nothing, if the writer is `capacity` items behind."""
        with self._changed:
            waiting = self._end() - self._written
            if waiting >= self.capacity:
                return False
            self._items.append(item)
            self.deepest = max(self.deepest, waiting + 1)
            self._changed.notify_all()
            return True

    def close(self) -> None:
        """Ends the list: nothing will be appended any more; waiting threads are woken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def room(self) -> int:
        """Number of items that the writer may still fall behind."""
        with self._changed:
            return self.capacity - (self._end() - self._written)

    def from_index(self, index: int, timeout_s: float) -> list[T]:
        """All items from an unforgotten index on; waits up to `timeout_s` for the first of them."""
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            return list(itertools.islice(self._items, index - self._first, None))

    def written(self, count: int) -> None:
        """Marks the next `count` items as on disk; all but the latest `capacity` of them are forgotten."""
        with self._changed:
            self._written += count
            # The latest stay in memory for the worker, which reads only forgotten ones from the file.
            while self._first < self._written and len(self._items) > self.capacity:
                self._items.popleft()
                self._first += 1
            self._changed.notify_all()

    def drop(self) -> None:
        """Forgets all items: they are on disk, and nobody will ask for one any more."""
        with self._changed:
            self._first = self._end()
            self._items.clear()

    def at(self, index: int, timeout_s: float) -> T | None:
        """The item at an index; None if it does not come in time, or never will.

        Raises:
            LookupError: It has been forgotten; it is on disk.
        """
        with self._changed:
            self._changed.wait_for(lambda: index < self._end() or self._closed, timeout_s)
            if index < self._first:
                raise LookupError(f"item {index} is forgotten, the oldest is {self._first}")
            return self._items[index - self._first] if index < self._end() else None

    def oldest(self) -> tuple[int, T]:
        """Index of the oldest item that is not forgotten, and the item.

        Raises:
            LookupError: Nothing was ever appended.
        """
        with self._changed:
            if not self._items:
                raise LookupError("nothing was ever appended")
            return self._first, self._items[0]

    def _end(self) -> int:
        return self._first + len(self._items)


class Recorder:
    """Takes fields until the capture has its length or is stopped; numbers them from the capture's first.

    Its ledger begins at the requested instant and ends when the capture is stopped: it has every field
    exposed between, lost ones included, and no other. A capture of given length always ends on time: a device
    that does not come back makes it incomplete, not endless. A source that waits for its reader has no pace,
    so its captures have no due end unless it is interrupted.

    Args:
        reader: Place in the ring; closed at the end.
        backlog: Queue for the fields; closed at the end.
        clock: Source of time.
        stream: The stream as the driver granted it.
        source: The pipeline, which knows the rate of the fields and why none come.
        fields: Length of the capture, or None.
        begin: Instant at which the capture begins; None: with the first field that comes.

    Attributes:
        reader: See above.
        backlog: See above.
        ledger: Account of the fields so far.
        ended_because: Reason for the end; None while it records.
        first_n: The stream's number of the capture's first field; None before that came.
        marks_before: Parity and located marks of the fields before it.
        fields: Number of fields that the file has or will have.
        length_fields: Length of the capture, lost fields included; None if it lasts until it is stopped.
        rate_hz: Fields per second.
    """

    def __init__(
        self,
        reader: RingReader,
        backlog: Backlog[Slot],
        clock: UtcClock,
        stream: StreamInfo,
        source: FieldPipeline,
        fields: int | None = None,
        begin: Begin | None = None,
    ) -> None:
        self.reader = reader
        self.backlog = backlog
        self.ledger = Ledger()
        self.ended_because: str | None = None
        self.first_n: int | None = None
        self.marks_before: list[tuple[int, Located]] = []
        self.fields = 0
        self.length_fields = fields
        self._clock = clock
        self._source = source
        self.rate_hz = stream.rate_hz
        self._lossless = stream.waits_for_reader
        self._keeps_pace = stream.live and not stream.waits_for_reader
        self._begin = begin or Begin(None, round(1e9 / stream.rate_hz))
        self._numbers = NumbersFromBegin(self._begin)
        self._start_ns = self._newest_ns = clock.now_ns()
        self._newest: Slot | None = None
        self._end_ns: int | None = None
        self._at_end = False
        self._refused: tuple[LedgerEntry, ...] = ()
        self._hearings = HEARINGS
        self._started = False

    def start(self, capture_id: str) -> None:
        """Starts recording in a separate thread; has no effect when repeated."""
        if not self._started:
            self._started = True
            runtime.Thread(target=self.run, name=f"recorder-{capture_id}", daemon=True).start()

    @property
    def recording(self) -> bool:
        """True while fields are taken."""
        return self.ended_because is None

    def stop(self, because: str) -> None:
        """Ends the recording; the first reason is kept."""
        if self.ended_because is None:
            # The ledger ends at this instant, even if the recorder notices it later.
            self._end_ns, self.ended_because = self._clock.now_ns(), because

    def abandon(self) -> None:
        """Ends the recording of a capture that could not be started."""
        self.stop("it could not be started")
        self.reader.close()

    def run(self) -> None:
        """Drains the ring until the recording ends, and then the rest of it."""
        try:
            while self.recording:
                self._take_one()
            self._take_until_end()
            self._account_for_absence()
        except RingOverrun as error:
            self._overrun(error)
        finally:
            self.reader.close()
            # Last: the writer takes a closed backlog to mean that the ledger is final.
            self.backlog.close()

    def take(self, slot: Slot) -> None:
        """Enters one slot of the ring; a slot beyond the capture's end ends it."""
        self._newest_ns, self._newest = self._clock.now_ns(), slot
        if self.first_n is None:
            first_n = self._begin.first_n(slot)
            if slot.n < first_n:
                return  # older than requested
            self.first_n = first_n
            self.marks_before = self._source.marks_before(first_n)
        end_n = self._end_n(slot, self.first_n)
        slot = renumbered(slot, self.first_n)
        if end_n is not None and slot.n >= end_n:
            self._close_at(end_n, slot)
            return
        events = self._numbers.events(slot)
        self.ledger.events += events
        self._enter(slot._replace(lost_before=(*self._refused, *slot.lost_before), rebases=events))
        if slot.n + 1 == self.length_fields:
            self.stop("length reached")

    def _end_n(self, slot: Slot, first_n: int) -> int | None:
        """Number after the last field of the capture; None while that is unknown."""
        if self._end_ns is None or not self._keeps_pace or self._begin.time_ns is None:
            return self.length_fields
        stopped_n = max(number_at(slot, self._end_ns, self._period_ns) - first_n, 0)
        return stopped_n if self.length_fields is None else min(stopped_n, self.length_fields)

    def _close_at(self, end_n: int, slot: Slot) -> None:
        """Enters the fields lost before the end, and ends the capture there."""
        self._at_end = True
        self._enter_refused()
        for entry in cut(slot.lost_before, 0, end_n):
            self.ledger.add(entry)
        reason = slot.lost_before[-1].reason if slot.lost_before else "time gap"
        self.ledger.close(end_n, reason)
        self.stop("length reached")

    @property
    def _period_ns(self) -> int:
        return round(1e9 / self._source.rate_hz)

    @property
    def _wants_more(self) -> bool:
        return self.length_fields is None or (self.ledger.end_n or 0) < self.length_fields

    def _overrun(self, error: RingOverrun) -> None:
        first_n = error.first_n - (self.first_n or 0)
        if self.first_n is not None:
            self.ledger.add(LedgerEntry(first_n, error.count, Outcome.OVERRUN, "ring overrun"))
        self.stop(error.message)

    def _take_one(self) -> None:
        slot = self.reader.take(TAKE_S)
        if slot is not None:
            self.take(slot)
        elif self._is_over and self._has_heard_enough():
            self._end_short(self._source.interruption or "nothing came")

    @property
    def _is_over(self) -> bool:
        """True if the time of a capture of given length has passed."""
        if self.length_fields is None or (self._lossless and self._source.interruption is None):
            return False
        begin_ns, missing = self._start_ns, self.length_fields
        # A source that waits follows its reader's pace: only the missing fields have a due time.
        if self._lossless:
            begin_ns, missing = self._newest_ns, self.length_fields - self.ledger.total
        return self._clock.now_ns() > begin_ns + missing * self._period_ns + GRACE_NS

    def _has_heard_enough(self) -> bool:
        """Waits for an explanation once more; True if there is one, or it has waited for long enough.

        The threads of a stopped program continue in any order: fields from the driver's buffers may still be
        on their way.
        """
        self._hearings -= 1
        return self._hearings < 0 or not self._keeps_pace or self._source.interruption is not None

    def _take_until_end(self) -> None:
        """Takes the fields exposed before the stop: the last ones are on their way, or in doubt.

        If none come, it waits for an explanation: a stall may not have been noticed yet.
        """
        hearings = HEARINGS if self._keeps_pace else 0
        while self._wants_more and not self._at_end:
            heard_out = hearings == 0 or self._source.interruption is not None
            slot = self.reader.take(0 if heard_out else HEARING_S)
            if slot is not None:
                self.take(slot)
            elif heard_out or self.reader.ended:
                return
            else:
                hearings -= 1

    @property
    def _is_silent(self) -> bool:
        silent_ns = self._clock.now_ns() - self._newest_ns
        return self._keeps_pace and silent_ns > SILENT_FIELDS * self._period_ns

    def _account_for_absence(self) -> None:
        """Enters the fields not delivered by a device that is away or stalled at the end."""
        self._enter_refused()
        reason = self._source.interruption or ("nothing came" if self._is_silent else None)
        if reason is None or self._lossless or self._at_end:
            return
        assert self._end_ns is not None, "stop() comes first"
        if self.first_n is None and self._begin.time_ns is not None:
            end_n = (self._end_ns - self._begin.time_ns) // self._period_ns
        elif self._newest is None or self.first_n is None or self._begin.time_ns is None:
            end_n = (self.ledger.end_n or 0) + (self._end_ns - self._newest_ns) // self._period_ns
        else:
            end_n = number_at(self._newest, self._end_ns, self._period_ns) - self.first_n
        self.ledger.close(end_n if self.length_fields is None else min(end_n, self.length_fields), reason)

    def _end_short(self, reason: str) -> None:
        assert self.length_fields is not None
        self._enter_refused()
        self.ledger.close(self.length_fields, reason)
        self.stop("length reached")

    def _enter_refused(self) -> None:
        """Enters the fields for which there was no room."""
        for entry in self._refused:
            self.ledger.add(entry)
        self._refused = ()

    def _enter(self, slot: Slot) -> None:
        self._refused = ()
        if self.backlog.append(slot):
            self.fields += slot.numbered is not None
            self.ledger.enter(slot.n, slot.outcome, slot.reason, slot.lost_before)
        else:
            # Not in the ledger yet: the next slot that finds room carries it, as lost before that one.
            self._refused = (*slot.lost_before, LedgerEntry(slot.n, 1, Outcome.OVERRUN, "disk too slow"))


def renumbered(slot: Slot, first_n: int) -> Slot:
    """The slot with its numbers counted from the capture's first field, and nothing before that."""
    numbered = slot.numbered and slot.numbered._replace(n=slot.numbered.n - first_n)
    lost = tuple(entry._replace(first_n=entry.first_n - first_n) for entry in cut(slot.lost_before, first_n))
    rebases = tuple(event._replace(n=event.n - first_n) for event in slot.rebases)
    return slot._replace(numbered=numbered, n=slot.n - first_n, lost_before=lost, rebases=rebases)
