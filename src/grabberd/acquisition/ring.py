"""The ring of packed fields between the capture thread and whoever reads them (paper 3.4: 32 of them)."""

from typing import NamedTuple

from grabberd.acquisition.ledger import LedgerEntry, Outcome
from grabberd.field import NumberedField


class Slot(NamedTuple):
    """One field in the ring, with what the ledger has to say up to it.

    Attributes:
        numbered: the field; None where there is nothing to keep (no signal).
        n: its number.
        outcome: received, damaged or no_signal.
        reason: None for a received field.
        lost_before: what never came between the field before it and this one.
    """

    numbered: NumberedField | None
    n: int
    outcome: Outcome
    reason: str | None
    lost_before: tuple[LedgerEntry, ...]


# class Ring: __init__(slots: int = 32); put(slot) never blocks; depth/level; reader(policy, back=0) -> RingReader
# class RingReader: take(timeout_s) -> Slot | None; close(); missed: int; policy count|stop;
#   what it was overtaken by appears in the next slot's lost_before as LedgerEntry(…, OVERRUN, "ring overrun")
