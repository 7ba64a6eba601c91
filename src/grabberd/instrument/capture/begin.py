"""Begin of a capture: its first field, and by how many its numbers are off from there on."""

from collections import deque
from dataclasses import dataclass, replace

from grabberd.core.ledger import UNCERTAIN, LedgerEvent, Outcome, Slot, numbers_off, too_high_by
from grabberd.instrument.acquisition import RingReader


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
