"""What became of every field that should have come."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


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
    count: int
    outcome: Outcome
    reason: str


@dataclass
class Ledger:
    """The account of one capture. A field is entered once, in order; `add` refuses what would count one twice."""

    # received: int; entries: list[LedgerEntry]
    # receive(n); add(entry); close(end_n, reason) -> enters what is missing up to end_n as lost
    # counts() -> dict[Outcome, int]; complete -> bool; in_words(rate_hz) -> "complete" | "3 fields lost at 12.40 s"
