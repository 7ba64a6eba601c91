"""From the ring into the recorder's own queue, with the ledger of one capture."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from grabberd.acquisition import Ledger, LedgerEntry, Outcome, RingReader, Slot
from grabberd.errors import RingOverrun
from grabberd.service.capture.backlog import Backlog
from grabberd.service.clock import Clock

GRACE_NS = 1_000_000_000
"""How long after its due end a capture of given length waits for fields that do not come."""
SILENT_FIELDS = 5
"""So many fields late, and the stream may stand still."""
HEARINGS, HEARING_S = 12, 0.1
"""How often and how long a silence at the end is listened to: until a stall would have been noticed."""


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """What is asked for; a capture ends after `fields` nominal field times, or when it is stopped.

    Attributes:
        fields: length in fields, lost ones included; None: until stopped.
        bits: bits a pixel; None: as configured.
        lines: "doubled" or "field"; None: doubled at 1 bit, field otherwise.
        pre_trigger_fields: how many fields before the request, or the trigger, belong to it, as far as the
            ring has them.
        overrun: "count" what the ring has overwritten before it was recorded, or "stop" the capture there.
        on_interruption: "continue" with the gap in the ledger when the device fails to deliver, or "end" the
            capture there; None: as configured.
        note: for people; `labels`: cow, teat, liner, …
    """

    fields: int | None = None
    bits: int | None = None
    lines: str | None = None
    pre_trigger_fields: int = 0
    overrun: str = "count"
    on_interruption: str | None = None
    note: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)


class Recorder:
    """Takes fields until the capture has its length or is stopped; numbers them from the capture's first.

    A capture of given length ends in its time, whatever comes: a device that does not come back makes it
    incomplete, not endless. A source that waits for its reader has no time of its own, unless it is
    interrupted.

    Args:
        fields: its length, or None.
        lossless: the source waits for its reader.
        live: the source has to deliver at its pace.
        interruption: why no fields come at this moment, or None while they do.

    Attributes:
        ledger: the account so far.
        ended_because: None while it records.
        first_n: the stream's number of the capture's first field, None before it came.
    """

    def __init__(
        self,
        fields: int | None,
        backlog: Backlog[Slot],
        clock: Clock,
        period_ns: int,
        *,
        lossless: bool = False,
        live: bool = True,
        interruption: Callable[[], str | None] = lambda: None,
    ) -> None:
        self.ledger = Ledger()
        self.ended_because: str | None = None
        self.first_n: int | None = None
        self._fields = fields
        self._backlog = backlog
        self._clock = clock
        self._period_ns = period_ns
        self._lossless = lossless
        self._keeps_pace = live and not lossless
        self._interruption = interruption
        self._start_ns = self._newest_ns = clock.now_ns()
        self._refused: tuple[LedgerEntry, ...] = ()
        self._started = False

    def start(self, reader: RingReader, name: str) -> None:
        """Begins to run in a thread of its own; does nothing the second time."""
        if not self._started:
            self._started = True
            threading.Thread(target=self.run, args=(reader,), name=f"recorder-{name}", daemon=True).start()

    @property
    def recording(self) -> bool:
        """Whether fields are still taken."""
        return self.ended_because is None

    def stop(self, because: str) -> None:
        """Ends the recording; the first reason given stays."""
        self.ended_because = self.ended_because or because

    def run(self, reader: RingReader) -> None:
        """Drains the ring until the recording ends; what lies in the ring at a stop still belongs to it."""
        try:
            while self.recording:
                self._take_one(reader)
            ended_ns = self._clock.now_ns()
            self._hear_out(reader)
            while self._wants_more and (slot := reader.take(0)) is not None:
                self.take(slot)
            self._account_for_absence(ended_ns)
        except RingOverrun as error:
            self._overrun(error)
        finally:
            reader.close()
            self._backlog.close()

    def take(self, slot: Slot) -> None:
        """Enters one slot of the ring; a slot beyond the capture's length ends it."""
        self._newest_ns = self._clock.now_ns()
        if self.first_n is None:
            self.first_n = slot.n
            slot = slot._replace(lost_before=())
        slot = rebased(slot, self.first_n)
        if self._fields is not None and slot.n >= self._fields:
            self._close_at_length(slot)
            return
        self._enter(slot._replace(lost_before=(*self._refused, *slot.lost_before)))
        if slot.n + 1 == self._fields:
            self.stop("length reached")

    @property
    def _wants_more(self) -> bool:
        return self._fields is None or (self.ledger.end_n or 0) < self._fields

    def _overrun(self, error: RingOverrun) -> None:
        first_n = error.first_n - (self.first_n or 0)
        if self.first_n is not None:
            self.ledger.add(LedgerEntry(first_n, error.count, Outcome.OVERRUN, "ring overrun"))
        self.stop(error.message)

    def _take_one(self, reader: RingReader) -> None:
        slot = reader.take(0.1)
        if slot is not None:
            self.take(slot)
        elif self._is_over:
            self._end_short(self._interruption() or "nothing came")

    @property
    def _is_over(self) -> bool:
        """Whether the time of a capture of given length has passed."""
        if self._fields is None or (self._lossless and self._interruption() is None):
            return False
        begin_ns, missing = self._start_ns, self._fields
        if self._lossless:
            begin_ns, missing = self._newest_ns, self._fields - self.ledger.total
        return self._clock.now_ns() > begin_ns + missing * self._period_ns + GRACE_NS

    def _hear_out(self, reader: RingReader) -> None:
        """A silence at the end may be a stall that nobody has noticed yet: until it is, or is over."""
        for _ in range(HEARINGS):
            if not (self._wants_more and self._is_silent) or self._interruption() is not None:
                return
            if (slot := reader.take(HEARING_S)) is not None:
                self.take(slot)

    @property
    def _is_silent(self) -> bool:
        silent_ns = self._clock.now_ns() - self._newest_ns
        return self._keeps_pace and silent_ns > SILENT_FIELDS * self._period_ns

    def _account_for_absence(self, ended_ns: int) -> None:
        """Enters what a device that is away, or stands still, at the end should have delivered until then."""
        reason = self._interruption() or ("nothing came" if self._is_silent else None)
        if reason is not None and not self._lossless:
            missing = (ended_ns - self._newest_ns) // self._period_ns
            end_n = (self.ledger.end_n or 0) + missing
            self.ledger.close(end_n if self._fields is None else min(end_n, self._fields), reason)

    def _close_at_length(self, slot: Slot) -> None:
        reason = slot.lost_before[-1].reason if slot.lost_before else "time gap"
        self._end_short(reason)

    def _end_short(self, reason: str) -> None:
        assert self._fields is not None
        for entry in self._refused:
            self.ledger.add(entry)
        self._refused = ()
        self.ledger.close(self._fields, reason)
        self.stop("length reached")

    def _enter(self, slot: Slot) -> None:
        self._refused = ()
        if self._backlog.append(slot):
            self._account(slot)
        else:
            self._refused = (*slot.lost_before, LedgerEntry(slot.n, 1, Outcome.OVERRUN, "disk too slow"))

    def _account(self, slot: Slot) -> None:
        self.ledger.enter(slot.n, slot.outcome, slot.reason, slot.lost_before)


def rebased(slot: Slot, first_n: int) -> Slot:
    """The slot with its numbers counted from the capture's first field."""
    numbered = slot.numbered and slot.numbered._replace(n=slot.numbered.n - first_n)
    lost = tuple(entry._replace(first_n=entry.first_n - first_n) for entry in slot.lost_before)
    return slot._replace(numbered=numbered, n=slot.n - first_n, lost_before=lost)
