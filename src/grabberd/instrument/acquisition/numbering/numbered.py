"""A field with its number, as it leaves the numbering."""

from typing import NamedTuple

from grabberd.core.ledger import LedgerEntry, LedgerEvent, Outcome


class Numbered(NamedTuple):
    """A grabbed field's number, time and outcome.

    Attributes:
        n: Nominal steps since numbering began, lost fields included; the first field is 0.
        time_ns: Middle of the exposure, smoothed if the stream is live.
        outcome: Received, damaged or no_signal.
        reason: Reason for the outcome; for a received field None, or why its time had to be predicted.
        lost_before: Fields missing between the previous field and this one: lost, or without a signal, since
            some drivers deliver nothing then.
        rebases: Changes of what numbers and times go by, from this field on.
    """

    n: int
    time_ns: int
    outcome: Outcome
    reason: str | None
    lost_before: tuple[LedgerEntry, ...]
    rebases: tuple[LedgerEvent, ...] = ()
