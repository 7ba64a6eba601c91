"""One field as the ring hands it to its readers, with everything that the ledger needs up to it."""

from typing import NamedTuple

from grabberd.core.field import NumberedField
from grabberd.core.ledger.ledger import LedgerEntry, Outcome
from grabberd.core.ledger.rebases import LedgerEvent


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
