"""Whether the causes in an account are those of the case."""

from collections.abc import Iterator

from grabberd.core.ledger import Ledger, LossCause, Outcome, cause_of_loss

from .cases import Case

_C = LossCause
POSSIBLE: dict[str, set[LossCause]] = {
    "fields lost on the bus": {_C.CABLE, _C.DEVICE},
    "fields lost, not counted by the driver": {_C.CABLE, _C.DEVICE},
    "program frozen": {_C.COMPUTER},
    "timestamp clock set while the program is frozen": {_C.COMPUTER},
    "computer busy": {_C.COMPUTER},
    "computer overloaded from the start": {_C.COMPUTER},
    "fields arrive in a burst": {_C.CABLE},
    "stall": {_C.DEVICE, _C.CABLE},
    "stream fails": {_C.DEVICE},
    "unplugged": {_C.DEVICE},
    "no signal, reported": {_C.CAMERA},
}
"""Causes of the fields that a fault costs; the other faults cost none. Only its length tells a stall,
.8 s and more, from fields lost on the bus."""
ALWAYS = {_C.UNKNOWN, _C.CONTENT}
"""Damaged fields: their number may be uncertain whatever happens, and noise may look like damage."""


def wrong_causes(case: Case, ledger: Ledger) -> Iterator[str]:
    """Sentences about losses whose cause is none of what went wrong."""
    possible = ALWAYS.union(*(POSSIBLE.get(kind, set()) for kind in case.kinds))
    for entry in ledger.entries:
        cause = cause_of_loss(entry.outcome, entry.reason)
        if cause not in possible and entry.outcome is not Outcome.DAMAGED:
            yield f"{entry.count} fields from {entry.first_n} on are said to be lost to {entry.reason}"
