"""Rebases: changes of what the numbers and times of fields go by."""

from enum import StrEnum
from typing import NamedTuple


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
    """The numbers had run ahead of the camera."""


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
