"""Losses before a field: how many, and what tells of them."""

import math

from grabberd.core.ledger import NO_SIGNAL, UNCERTAIN, LedgerEntry, never_came
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending

TIME_GAP = "time gap"
SEQUENCE_GAP = "sequence gap"
REPEATED_PARITY = "repeated parity"
_LATE = 0.75
"""Periods by which a field that has not waited may arrive late."""
GAPS = {TIME_GAP, SEQUENCE_GAP, REPEATED_PARITY}


def lost_before(pending: Pending, step: Step, first_n: int) -> tuple[LedgerEntry, ...]:
    """The entry for the fields from `first_n` on that are missing before a field; none if none are."""
    count = step.fields - 1
    if not count:
        return ()
    gap = NO_SIGNAL if pending.no_signal else pending.standstill or _gap(pending, step)
    reason = pending.interruption or gap
    return (never_came(first_n, count, reason),)


def _gap(pending: Pending, step: Step) -> str:
    if pending.time_ns is not None and step.late is not None and abs(step.late) <= 0.5:
        return TIME_GAP
    if pending.count == step.fields:
        return SEQUENCE_GAP
    by_parity = pending.time_ns is None and pending.phase is not None
    return REPEATED_PARITY if by_parity else TIME_GAP


def doubtful(lost: tuple[LedgerEntry, ...], uncertain_by: int) -> tuple[LedgerEntry, ...]:
    """The same entries, where it is uncertain whether the fields are missing at all: then no cable has cost
    them. An interruption and a computer that was busy are known besides, however many fields they have cost.
    """
    reason = f"{UNCERTAIN} {uncertain_by}"
    return tuple(one._replace(reason=reason) if one.reason in GAPS else one for one in lost)


def uncounted(pending: Pending, step: Step) -> int:
    """Number of fields that were lost before one without the driver's notice."""
    if pending.interruption:
        return 0
    return abs(step.fields - (1 if pending.count is None else pending.count))


def contradiction(pending: Pending, step: Step) -> int:
    """Number of fields by which evidence differs: stamp and count, where no arrival tells which of them is
    wrong, or after an interruption a stamp and the arrival of a field that has not waited.
    """
    if pending.interruption:
        has_waited = not pending.in_time or step.arrived is None or step.arrived <= _LATE
        return 0 if has_waited else math.ceil(step.arrived or 0.0)
    if pending.count is None or step.arrived_in_time:
        return 0
    return abs(pending.count - step.fields)
