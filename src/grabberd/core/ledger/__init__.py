"""The ledger: every field that should have come, by what became of it, and why.

`ledger` accounts for all fields of a capture, `causes` tells where to look for what is missing, `rebases` by
what numbers and times go, and a `slot` is one field with what was lost before it.
"""

from grabberd.core.ledger.causes import LossCause, cause_of_loss
from grabberd.core.ledger.ledger import NO_SIGNAL, UNCERTAIN, Ledger, LedgerEntry, Outcome, never_came
from grabberd.core.ledger.rebases import LedgerEvent, Rebase, numbers_off, too_high_by
from grabberd.core.ledger.slot import Slot

__all__ = [
    "NO_SIGNAL",
    "UNCERTAIN",
    "Ledger",
    "LedgerEntry",
    "LedgerEvent",
    "LossCause",
    "Outcome",
    "Rebase",
    "Slot",
    "cause_of_loss",
    "never_came",
    "numbers_off",
    "too_high_by",
]
