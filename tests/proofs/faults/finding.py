"""What came of a fault of the machine or of its clients."""

from typing import NamedTuple

from .evidence import Evidence
from .judging import of_the_machine


class Finding(NamedTuple):
    """A row of the table.

    Attributes:
        behaviour: in words; `noticed_s`, `recovered_s`: None where there was nothing to notice or recover.
        problems: what is not as it has to be.
    """

    behaviour: str
    noticed_s: float | None
    recovered_s: float | None
    problems: tuple[str, ...] = ()


def unless(*facts: tuple[bool, str]) -> tuple[str, ...]:
    """The sentences of which the fact is not so."""
    return tuple(words for so, words in facts if not so)


def nothing_lost(evidence: Evidence, *allowed: str) -> tuple[str, ...]:
    """What does not add up, or is missing for a reason that is neither allowed nor the machine's own."""
    entries = [
        entry
        for entry in evidence.ledger.entries
        if not of_the_machine(entry) and entry.reason not in allowed
    ]
    return (*evidence.problems, *(f"missing: {entry}" for entry in entries))
