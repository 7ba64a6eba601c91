"""Recording: from the ring into the capture's own queue, from its first field to its last, with a ledger.

Begin of a capture: its first field, and by how many its numbers are off from there on.
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

from grabberd import runtime
from grabberd.core.ledger import (
    UNCERTAIN,
    Ledger,
    LedgerEntry,
    LedgerEvent,
    Outcome,
    Slot,
    numbers_off,
    too_high_by,
)
from grabberd.core.measurement.marks import Located
from grabberd.errors import RingOverrun
from grabberd.instrument.acquisition import Backlog, RingReader, StreamInfo
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.runtime import UtcClock


@dataclass(frozen=True, slots=True)
class Begin:
    """Begin of a capture; its first field is not older.

    Attributes:
        time_ns: The instant of the request or trigger, less the pre-trigger as far as the ring has it; None
            for a source whose times are not those of the clock: its captures begin with the first field that
            comes.
        period_ns: Nominal time from field to field.
        n: Number of the first field, if the ring had one near it; by jitter, each field gives another.
    """

    time_ns: int | None
    period_ns: int
    n: int | None = None

    @classmethod
    def of(cls, reader: RingReader, asked_ns: int | None, pre_fields: int, period_ns: int) -> "Begin":
        """Begin of a capture that was requested, or triggered, at an instant.

        If the ring has had no field yet, there is no pre-trigger either, even if fields are on their way.
        """
        if asked_ns is None:
            return cls(None, period_ns)
        if reader.oldest is None:
            return cls(asked_ns, period_ns)
        begin = cls(max(asked_ns - pre_fields * period_ns, _first_ns(reader.oldest, period_ns)), period_ns)
        return replace(begin, n=begin.first_n(reader.oldest))

    def first_n(self, slot: Slot) -> int:
        """Number of the first field that belongs to the capture, derived from a field near it.

        That may be a later one than `slot`, which is then too old, or one that was lost before it.
        """
        if self.n is not None:
            return self.n
        if self.time_ns is None:
            return slot.n
        # Fields before the oldest slot of the ring are not missing: it never had them, or no longer has.
        return max(number_at(slot, self.time_ns, self.period_ns), slot.first_n)


_MEASURED = 100
"""Fields without a loss that measure the camera's rate during a doubt."""


class NumbersFromBegin:
    """Finds by how many the numbers of a capture are off, beyond what the stream has reported.

    A doubt about numbers may have begun before the capture, and an overrun of the ring may drop reports with
    their fields. The next certain number is then compared with the time.

    Args:
        begin: Of the capture.
    """

    def __init__(self, begin: Begin) -> None:
        self._begin = begin
        self._certain: tuple[int, int] | None = None
        self._is_followed = self._began_in_doubt = False
        self._reported = 0
        self._in_a_row: deque[tuple[int, int]] = deque(maxlen=_MEASURED)

    def events(self, slot: Slot) -> tuple[LedgerEvent, ...]:
        """The changes with a slot that is numbered from the capture's first field."""
        if self._begin.time_ns is None:
            return slot.rebases
        if any(entry.outcome is Outcome.OVERRUN for entry in slot.lost_before):
            self._is_followed = False
        is_certain = not (slot.reason or "").startswith(UNCERTAIN)
        events = slot.rebases
        if not is_certain:
            self._measure(slot)
        if is_certain and not self._is_followed:
            events = tuple(event for event in events if not too_high_by(event))
            if off := self._off(slot, self._begin.time_ns):
                events = (*events, numbers_off(slot.n, off))
        self._reported += sum(too_high_by(event) for event in events)
        if is_certain:
            self._certain, self._reported, self._is_followed = (slot.n, slot.time_ns), 0, True
        self._began_in_doubt |= not is_certain
        return events

    def _off(self, slot: Slot, begin_ns: int) -> int:
        """Fields by which a certain number is too high, counted from the last certain one or the begin."""
        if self._certain is None:
            off = number_at(slot, begin_ns, self._period_ns) if self._began_in_doubt else 0
            return off - self._reported
        n, time_ns = self._certain
        return slot.n - n - round((slot.time_ns - time_ns) / self._period_ns) - self._reported

    def _measure(self, slot: Slot) -> None:
        """Note a field of a doubt, which may last so long that the camera's own rate matters."""
        if slot.lost_before or slot.rebases:
            self._in_a_row.clear()
        self._in_a_row.append((slot.n, slot.time_ns))

    @property
    def _period_ns(self) -> int:
        if len(self._in_a_row) < _MEASURED:
            return self._begin.period_ns
        (first_n, first_ns), (last_n, last_ns) = self._in_a_row[0], self._in_a_row[-1]
        return round((last_ns - first_ns) / (last_n - first_n))


def _first_ns(oldest: Slot, period_ns: int) -> int:
    """Time just before the first field that the ring still has, or has lost before its oldest slot."""
    return oldest.time_ns - (oldest.n - oldest.first_n) * period_ns - period_ns // 2


def number_at(slot: Slot, time_ns: int, period_ns: int) -> int:
    """Number of the first field that is not exposed before a given time."""
    return slot.n - (slot.time_ns - time_ns) // period_ns


def fields_before(reader: RingReader, newest: Slot | None, begin: Begin, trigger_ns: int) -> int:
    """Number of fields from the begin of a capture to its trigger, as far as the ring has them."""
    if reader.oldest is None or newest is None:
        return 0
    first_n = begin.first_n(reader.oldest)
    if begin.time_ns is None:
        return newest.n + 1 - first_n
    return max(number_at(newest, trigger_ns, begin.period_ns) - first_n, 0)


def cut(entries: Iterable[LedgerEntry], first_n: int, end_n: float = math.inf) -> tuple[LedgerEntry, ...]:
    """The part of the entries with first_n ≤ n < end_n."""
    parts = []
    for entry in entries:
        first, end = max(entry.first_n, first_n), min(entry.end_n, end_n)
        if first < end:
            parts.append(entry._replace(first_n=first, count=int(end) - first))
    return tuple(parts)


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
