"""What became of every field that should have come."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple


class Outcome(StrEnum):
    """What became of a field."""

    RECEIVED = "received"
    LOST = "lost"
    DAMAGED = "damaged"
    NO_SIGNAL = "no_signal"
    OVERRUN = "overrun"


class LedgerEntry(NamedTuple):
    """Consecutive fields that share an outcome and its reason; `received` ones are counted, not listed.

    Attributes:
        first_n: number of the first of them.
        count: how many.
        outcome: never `received`.
        reason: in a few words, e.g. "time gap", "sequence gap", "unplugged", "ring overrun".
    """

    first_n: int
    count: int  # type: ignore[assignment]  # hides a method of tuple that nobody needs here
    outcome: Outcome
    reason: str

    @property
    def end_n(self) -> int:
        """The number after the last of them."""
        return self.first_n + self.count


NO_SIGNAL = "no signal"
"""Reason of fields that came, or did not come, because there was no camera."""

UNACCOUNTED = "not accounted for"
"""Reason of fields between two entries for which nobody gave one."""


def never_came(first_n: int, count: int, reason: str) -> LedgerEntry:
    """Fields that should have come: lost, unless there was no camera to send them."""
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
    """The account of one capture: every number from `first_n` up to `end_n` is in it exactly once.

    Fields are entered in order of their numbers. A number that was entered before is refused; numbers that
    are skipped are entered as lost, not accounted for.

    Attributes:
        first_n: where the account begins; None until something is entered.
        received: how many fields came whole.
        entries: everything else, in order, neighbours of one outcome and reason merged.
    """

    first_n: int | None = None
    received: int = 0
    entries: list[LedgerEntry] = field(default_factory=list)
    _end_n: int | None = None

    @property
    def end_n(self) -> int | None:
        """The number after the last one entered, or None."""
        return self.first_n if self._end_n is None else self._end_n

    @property
    def total(self) -> int:
        """How many fields should have come."""
        return 0 if self.first_n is None or self._end_n is None else self._end_n - self.first_n

    def receive(self, n: int) -> None:
        """Enters field `n` as received.

        Raises:
            ValueError: it is in the ledger already.
        """
        self._advance(n, 1)
        self.received += 1

    def add(self, entry: LedgerEntry) -> None:
        """Enters what became of some fields.

        Raises:
            ValueError: one of them is in the ledger already, there are none of them, or they were received.
        """
        if entry.count < 1 or entry.outcome is Outcome.RECEIVED:
            raise ValueError(f"not a ledger entry: {entry}")
        self._advance(entry.first_n, entry.count)
        self._merge(entry)

    def enter(self, n: int, outcome: Outcome, reason: str | None, before: Iterable[LedgerEntry] = ()) -> None:
        """Enters field `n`, whatever became of it, after what never came before it.

        Raises:
            ValueError: one of them is in the ledger already.
        """
        for entry in before:
            self.add(entry)
        if outcome is Outcome.RECEIVED:
            self.receive(n)
        else:
            self.add(LedgerEntry(n, 1, outcome, reason or str(outcome)))

    def close(self, end_n: int, reason: str) -> None:
        """Enters what never came before `end_n`; does nothing where nothing is missing."""
        if self.first_n is None:
            self.first_n = 0
        first = self._end_n if self._end_n is not None else self.first_n
        if end_n > first:
            self.add(never_came(first, end_n - first, reason))

    def counts(self) -> dict[Outcome, int]:
        """How many fields met each outcome; all outcomes, zeros too."""
        counts = dict.fromkeys(Outcome, 0)
        counts[Outcome.RECEIVED] = self.received
        for entry in self.entries:
            counts[entry.outcome] += entry.count
        return counts

    @property
    def complete(self) -> bool:
        """Whether fields came and every one of them whole."""
        return self.received > 0 and not self.entries

    def in_words(self, rate_hz: float) -> str:
        """For people, e.g. "3 fields lost at 12.40 s (time gap)"; seconds count from the first field."""
        if self.complete:
            return "complete"
        if not self.entries:
            return "no fields"
        words = [self._entry_in_words(entry, rate_hz) for entry in self.entries[:_LISTED]]
        rest = sum(entry.count for entry in self.entries[_LISTED:])
        return "; ".join(words + ([f"and {_fields(rest)} more"] if rest else []))

    def to_document(self) -> dict[str, Any]:
        """The account as JSON-able values; `from_document` gives it back."""
        return {
            "first_n": self.first_n,
            "end_n": self._end_n,
            "received": self.received,
            "entries": [{**entry._asdict(), "outcome": str(entry.outcome)} for entry in self.entries],
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Ledger":
        """The account from what `to_document` gave."""
        entries = [
            LedgerEntry(row["first_n"], row["count"], Outcome(row["outcome"]), row["reason"])
            for row in document["entries"]
        ]
        return cls(document["first_n"], document["received"], entries, document["end_n"])

    @classmethod
    def restore(
        cls,
        received_n: Sequence[int],
        entries: Sequence[LedgerEntry],
        *,
        first_n: int | None = None,
        gap: str = UNACCOUNTED,
    ) -> "Ledger":
        """The account from the numbers that were received (ascending) and the entries, as a file keeps them.

        Args:
            received_n: numbers of received fields.
            entries: what became of others.
            first_n: where the account begins, if earlier than any of them.
            gap: reason of the fields that neither speaks of.

        Raises:
            ValueError: a field is counted twice.
        """
        ledger = cls(first_n)
        events = [(n, None) for n in received_n] + [(entry.first_n, entry) for entry in entries]
        for n, entry in sorted(events, key=lambda event: event[0]):
            if ledger.end_n is not None:
                ledger.close(n, gap)
            ledger.receive(n) if entry is None else ledger.add(entry)
        return ledger

    def _advance(self, first_n: int, count: int) -> None:
        if self.first_n is None:
            self.first_n = first_n
        end_n = self.first_n if self._end_n is None else self._end_n
        if first_n < end_n:
            raise ValueError(f"field {first_n} is in the ledger already, which has come to {end_n}")
        if first_n > end_n:
            self._merge(LedgerEntry(end_n, first_n - end_n, Outcome.LOST, UNACCOUNTED))
        self._end_n = first_n + count

    def _merge(self, entry: LedgerEntry) -> None:
        last = self.entries[-1] if self.entries else None
        if last and last.end_n == entry.first_n and last[2:] == entry[2:]:
            self.entries[-1] = last._replace(count=last.count + entry.count)
        else:
            self.entries.append(entry)

    def _entry_in_words(self, entry: LedgerEntry, rate_hz: float) -> str:
        seconds = (entry.first_n - (self.first_n or 0)) / rate_hz
        return f"{_fields(entry.count)} {_WORDS[entry.outcome]} at {seconds:.2f} s ({entry.reason})"


def _fields(count: int) -> str:
    return "1 field" if count == 1 else f"{count} fields"
