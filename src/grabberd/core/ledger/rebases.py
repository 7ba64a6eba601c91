"""Rebases: changes of what the numbers and times of fields go by."""

import re
from enum import StrEnum
from typing import NamedTuple

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


def too_high_by(event: LedgerEvent) -> int:
    """Number of fields that an event of `numbers_off` tells; 0 for any other."""
    found = _NUMBERS_OFF.search(event.reason)
    return 0 if found is None else int(found[1]) * (1 if found[2] == "high" else -1)
