"""The ledger: every field that should have come, by what became of it, and why.

A `Ledger` accounts for all fields of a capture, a `Rebase` is a change of what numbers and times go by, a
`Slot` is one field with what was lost before it, and a `LossCause` says where to look for what is missing.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from grabberd.core.field import NumberedField
from grabberd.errors import count_of

_NUMBERS_UNSURE = re.compile(r"numbers from here on may be up to (\d+) too high or too low")
_NUMBERS_OFF = re.compile(r"numbers from here on are (\d+) too (high|low)")


class Rebase(StrEnum):
    """Kind of a change; each is entered once, with the first field that goes by the new base."""

    CLOCK = "clock"
    """The clock of the timestamps was set."""
    ARRIVALS = "arrivals"
    """The timestamps are not believed any more: arrivals, count and parity take over."""
    TIMESTAMPS = "timestamps"
    """The timestamps are believed again."""
    BEGIN = "begin"
    """The first timestamps of a stream were late: its times begin again."""
    COUNT = "count"
    """The driver's count has restarted or skipped."""
    PHASE = "phase"
    """The camera goes on in the other phase: its top fields have odd numbers now, or even ones again."""
    NUMBERS = "numbers"
    """A doubt about numbers has ended, and what was numbered in it was not as many as the camera's fields."""
    RATE = "rate"
    """The camera delivers another number of pictures a second than before."""


class LedgerEvent(NamedTuple):
    """A rebase, as a ledger has it.

    Attributes:
        n: Number of the first field that goes by the new base.
        kind: What has changed.
        reason: The change in words, with its values.
    """

    n: int
    kind: Rebase
    reason: str


def numbers_off(n: int, too_high_by: int) -> LedgerEvent:
    """The event that numbers are too high from a field on by so many, or too low where that is negative."""
    what = (
        "high: as many fields entered as lost were not" if too_high_by > 0 else "low: as many more were lost"
    )
    return LedgerEvent(n, Rebase.NUMBERS, f"the numbers from here on are {abs(too_high_by)} too {what}")


_UNKNOWN_RATE = "the camera's rate is not known well enough for the gap"


def numbers_unsure(n: int, by_up_to: int, because: str = _UNKNOWN_RATE) -> LedgerEvent:
    """The event that numbers from a field on may be off by so many, and why."""
    reason = f"the numbers from here on may be up to {by_up_to} too high or too low"
    return LedgerEvent(n, Rebase.NUMBERS, f"{reason}: {because}")


def unsure_by(event: LedgerEvent) -> int:
    """Number of fields that an event of `numbers_unsure` tells; 0 for any other."""
    found = _NUMBERS_UNSURE.search(event.reason)
    return 0 if found is None else int(found[1])


def too_high_by(event: LedgerEvent) -> int:
    """Number of fields that an event of `numbers_off` tells; 0 for any other."""
    found = _NUMBERS_OFF.search(event.reason)
    return 0 if found is None else int(found[1]) * (1 if found[2] == "high" else -1)


class Outcome(StrEnum):
    """Outcome of a field."""

    RECEIVED = "received"
    LOST = "lost"
    DAMAGED = "damaged"
    NO_SIGNAL = "no_signal"
    OVERRUN = "overrun"


class LedgerEntry(NamedTuple):
    """Consecutive fields with the same outcome and reason; received fields are counted, not listed.

    Attributes:
        first_n: Number of the first field.
        count: Number of fields.
        outcome: Never `received`.
        reason: A few words, e.g. "time gap", "sequence gap", "unplugged", "ring overrun"; `causes` tells what
            each stands for.
    """

    first_n: int
    count: int  # type: ignore[assignment]  # shadows tuple.count, which nobody needs here
    outcome: Outcome
    reason: str

    @property
    def end_n(self) -> int:
        """The number after the last field."""
        return self.first_n + self.count


NO_SIGNAL = "no signal"
"""Reason for fields that are empty or missing because no camera was connected."""

OF_FRAME_BEFORE = "may be of the frame before"
"""Reason for fields after a gap of which the driver cannot tell."""

UNCERTAIN = "number uncertain by up to"
"""Reason for fields whose number may be wrong, before the number of fields that it may be off by."""

UNCLEAR = "unclear"
"""Reason for fields that were lost in one of several ways, before those."""

UNACCOUNTED = "not accounted for"
"""Reason for fields between two entries for which none was given."""

FILE_DAMAGED = "lost with a part of the file"
"""Reason for fields and readings that had been recorded, in a file that lacks a part."""


def never_came(first_n: int, count: int, reason: str) -> LedgerEntry:
    """Make an entry for fields that never came: lost, unless no camera was connected."""
    outcome = Outcome.NO_SIGNAL if reason == NO_SIGNAL else Outcome.LOST
    return LedgerEntry(first_n, count, outcome, reason)


_WORDS = {
    Outcome.LOST: "lost",
    Outcome.DAMAGED: "damaged",
    Outcome.NO_SIGNAL: "without signal",
    Outcome.OVERRUN: "overrun",
}
_LISTED = 5


@dataclass
class Ledger:
    """Account of one capture: every number from `first_n` up to `end_n` occurs exactly once.

    Fields are entered in ascending order. A number entered before is refused; skipped numbers are entered as
    lost, "not accounted for".

    Attributes:
        first_n: First number of the account; None until something is entered.
        received: Number of fields received intact.
        entries: All other fields, in order; neighbours with the same outcome and reason are merged.
        events: Changes of what numbers and times go by, in order.
        most: Number of entries that are kept, and the last one beside them; None: all.
        unlisted: Number of entries that are not kept.
    """

    first_n: int | None = None
    received: int = 0
    entries: list[LedgerEntry] = field(default_factory=list)
    events: list[LedgerEvent] = field(default_factory=list)
    _end_n: int | None = None
    most: int | None = None
    unlisted: int = 0
    _unlisted_fields: dict[Outcome, int] = field(default_factory=lambda: dict.fromkeys(Outcome, 0))

    @property
    def end_n(self) -> int | None:
        """The number after the last field entered, or None."""
        return self.first_n if self._end_n is None else self._end_n

    @property
    def total(self) -> int:
        """Number of fields that should have come."""
        return 0 if self.first_n is None or self._end_n is None else self._end_n - self.first_n

    def receive(self, n: int, count: int = 1) -> None:
        """Enter consecutive fields from `n` on as received.

        Raises:
            ValueError: One of them is in the ledger already.
        """
        self._advance(n, count)
        self.received += count

    def add(self, entry: LedgerEntry) -> None:
        """Enter fields with an outcome other than `received`.

        Raises:
            ValueError: One of them is in the ledger already, the count is below 1, or the outcome is
                `received`.
        """
        if entry.count < 1 or entry.outcome is Outcome.RECEIVED:
            raise ValueError(f"not a ledger entry: {entry}")
        self._advance(entry.first_n, entry.count)
        self._merge(entry)

    def enter(self, n: int, outcome: Outcome, reason: str | None, before: Iterable[LedgerEntry] = ()) -> None:
        """Enter field `n` with any outcome, after the fields that were lost before it.

        Raises:
            ValueError: One of them is in the ledger already.
        """
        for entry in before:
            self.add(entry)
        if outcome is Outcome.RECEIVED:
            self.receive(n)
        else:
            self.add(LedgerEntry(n, 1, outcome, reason or str(outcome)))

    def close(self, end_n: int, reason: str) -> None:
        """Enter the fields missing up to `end_n`; does nothing if none are."""
        if self.first_n is None:
            self.first_n = 0
        first = self._end_n if self._end_n is not None else self.first_n
        if end_n > first:
            self.add(never_came(first, end_n - first, reason))

    def counts(self) -> dict[Outcome, int]:
        """Number of fields by outcome, including outcomes that did not occur."""
        counts = {**self._unlisted_fields, Outcome.RECEIVED: self.received}
        for entry in self.entries:
            counts[entry.outcome] += entry.count
        return counts

    @property
    def complete(self) -> bool:
        """True if at least one field came and every field was received intact."""
        return self.received > 0 and not (self.entries or self.unlisted)

    def in_words(self, rate_hz: float) -> str:
        """Describe the losses, e.g. "3 fields lost at 12.40 s (time gap)", and after them the events; seconds
        count from the first field.
        """
        words = [self._entry_in_words(entry, rate_hz) for entry in self.entries[:_LISTED]]
        rest = sum(entry.count for entry in self.entries[_LISTED:]) + sum(self._unlisted_fields.values())
        if rest:
            words.append(f"and {count_of(rest, 'field')} more")
        words = words or ["complete" if self.complete else "no fields"]
        events = [f"{event.reason} at {self._seconds(event.n, rate_hz)}" for event in self.events[:_LISTED]]
        if others := len(self.events[_LISTED:]):
            events.append(f"and {others} more {'change' if others == 1 else 'changes'}")
        return "; ".join(words + events)

    @classmethod
    def counted(
        cls,
        first_n: int,
        end_n: int,
        received: int,
        others: Mapping[Outcome, int],
        entries: list[LedgerEntry],
        unlisted: int,
        events: Sequence[LedgerEvent],
    ) -> "Ledger":
        """An account whose fields were counted elsewhere.

        Args:
            first_n: First number.
            end_n: The number after the last.
            received: Number of fields received intact.
            others: Numbers of all other fields by outcome.
            entries: The first entries.
            unlisted: Number of further entries.
            events: Changes of what numbers and times go by.
        """
        ledger = cls(first_n, received, entries, list(events), end_n, len(entries), unlisted)
        further = {**ledger._unlisted_fields, **others}
        for entry in entries:
            further[entry.outcome] -= entry.count
        ledger._unlisted_fields = further
        return ledger

    @classmethod
    def restore(
        cls,
        received_n: Sequence[int],
        entries: Sequence[LedgerEntry],
        *,
        events: Sequence[LedgerEvent] = (),
        first_n: int | None = None,
        gap: str = UNACCOUNTED,
    ) -> "Ledger":
        """Restore an account from received numbers and entries, as a capture file keeps them.

        Args:
            received_n: Numbers of the received fields, ascending.
            entries: Outcomes of the others.
            events: Changes of what numbers and times go by.
            first_n: First number of the account, if earlier than any of them.
            gap: Reason for fields that occur in neither.

        Raises:
            ValueError: A field is counted twice.
        """
        ledger = cls(first_n, events=list(events))
        all_of_them = [(n, None) for n in received_n] + [(entry.first_n, entry) for entry in entries]
        for n, entry in sorted(all_of_them, key=lambda one: one[0]):
            if ledger.end_n is not None:
                ledger.close(n, gap)
            ledger.receive(n) if entry is None else ledger.add(entry)
        return ledger

    def _advance(self, first_n: int, count: int) -> None:
        if self.first_n is None:
            self.first_n = first_n
        end_n = self.first_n if self._end_n is None else self._end_n
        if first_n < end_n:
            raise ValueError(f"field {first_n} is in the ledger already, which ends at {end_n}")
        if first_n > end_n:
            self._merge(LedgerEntry(end_n, first_n - end_n, Outcome.LOST, UNACCOUNTED))
        self._end_n = first_n + count

    def _merge(self, entry: LedgerEntry) -> None:
        last = self.entries[-1] if self.entries else None
        if last and last.end_n == entry.first_n and last[2:] == entry[2:]:
            self.entries[-1] = last._replace(count=last.count + entry.count)
            return
        if last and self.most is not None and len(self.entries) > self.most:
            self.entries.pop()
            self.unlisted += 1
            self._unlisted_fields[last.outcome] += last.count
        self.entries.append(entry)

    def _entry_in_words(self, entry: LedgerEntry, rate_hz: float) -> str:
        at = self._seconds(entry.first_n, rate_hz)
        return f"{count_of(entry.count, 'field')} {_WORDS[entry.outcome]} at {at} ({entry.reason})"

    def _seconds(self, n: int, rate_hz: float) -> str:
        return f"{(n - (self.first_n or 0)) / rate_hz:.2f} s"


class Slot(NamedTuple):
    """One field in the ring, with everything the ledger needs up to it.

    Attributes:
        numbered: The field, with its picture whatever became of it; None if there is none.
        n: Number of the field.
        outcome: Received, damaged or no_signal.
        reason: None for a received field, unless its time had to be predicted.
        lost_before: Fields missing between the previous field and this one.
        time_ns: Middle of its exposure.
        rebases: Changes of what numbers and times go by, from this field on.
    """

    numbered: NumberedField | None
    n: int
    outcome: Outcome
    reason: str | None
    lost_before: tuple[LedgerEntry, ...]
    time_ns: int
    rebases: tuple[LedgerEvent, ...] = ()

    @property
    def first_n(self) -> int:
        """First number that this slot accounts for."""
        return self.lost_before[0].first_n if self.lost_before else self.n


class LossCause(StrEnum):
    """Place to look at."""

    COMPUTER = "computer"
    """The computer was busy, or the program was stopped or ended: it took no fields in time."""
    CABLE = "cable"
    """Bus or cable: the program asked in time for fields that did not come, or came in part."""
    CAMERA = "camera"
    """The camera or its signal."""
    CONTENT = "content"
    """The picture shows what nobody told: lines shifted, stale or repeated."""
    DEVICE = "device"
    """The grabber was gone, or had stopped, or its driver did not return from a call."""
    DISK = "disk"
    UNKNOWN = "unknown"


_BY_REASON = (
    ("computer busy", LossCause.COMPUTER),
    ("program stopped", LossCause.COMPUTER),
    ("driver hung", LossCause.DEVICE),
    ("the program ended", LossCause.COMPUTER),
    ("ring overrun", LossCause.COMPUTER),
    ("disk too slow", LossCause.DISK),
    ("not written to disk", LossCause.DISK),
    (FILE_DAMAGED, LossCause.DISK),
    ("time gap", LossCause.CABLE),
    ("sequence gap", LossCause.CABLE),
    ("repeated parity", LossCause.CABLE),
    ("the driver flags an error", LossCause.CABLE),
    (OF_FRAME_BEFORE, LossCause.CABLE),
    ("short:", LossCause.CABLE),
    ("parity contradicts time", LossCause.CAMERA),
    (UNCERTAIN, LossCause.UNKNOWN),
    (UNCLEAR, LossCause.UNKNOWN),
    ("nothing came", LossCause.UNKNOWN),
    (NO_SIGNAL, LossCause.CAMERA),
    (UNACCOUNTED, LossCause.UNKNOWN),
)
_BY_OUTCOME = {
    Outcome.LOST: LossCause.DEVICE,
    Outcome.DAMAGED: LossCause.CONTENT,
    Outcome.NO_SIGNAL: LossCause.CAMERA,
    Outcome.OVERRUN: LossCause.COMPUTER,
}
"""Of all other reasons: those of lost fields are the drivers' own words, those of damaged ones come from the
checks of the content."""


def cause_of_loss(outcome: Outcome, reason: str) -> LossCause:
    """Cause of an entry of the ledger.

    Raises:
        KeyError: The outcome is `received`.
    """
    return next((cause for words, cause in _BY_REASON if reason.startswith(words)), _BY_OUTCOME[outcome])
