"""Causes of losses: full buffers, a standstill of the whole computer, the way to it, or one of them."""

import math
from collections.abc import Iterator

from grabberd.core.ledger import NO_SIGNAL, UNCERTAIN, UNCLEAR, LedgerEntry, never_came
from grabberd.instrument.acquisition.numbering.arrivals import Arrivals
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending
from grabberd.instrument.acquisition.numbering.standstill import Standstill, StandstillOfDriver

TIME_GAP = "time gap"
SEQUENCE_GAP = "sequence gap"
REPEATED_PARITY = "repeated parity"
GAPS = {TIME_GAP, SEQUENCE_GAP, REPEATED_PARITY}
_OF_STANDSTILL = 0.5
"""Fields, and those of a buffer, by which a loss may be shorter than a standstill of the driver."""
_LONG = 4
"""Fields lost in a row that are hardly lost on the bus right after a standstill."""


class Causes:
    """Finds what lost the fields before each one; several causes that fit are all named.

    Args:
        arrivals: Those of the stream.
        pace: Of the camera.
        buffered_ns: Time that fills the driver's buffers, after which it may as well have stood still.

    Attributes:
        held_by: Number of fields lost before the last one that may as well be missing behind it.
    """

    def __init__(self, arrivals: Arrivals, pace: Pace, buffered_ns: int) -> None:
        self._arrivals = arrivals
        self._pace = pace
        self._buffered_ns = buffered_ns
        self._blamed: set[Standstill] = set()
        self.held_by = 0

    def lost_before(self, pending: Pending, step: Step, n: int, time_ns: int) -> tuple[LedgerEntry, ...]:
        """The entries for the fields missing before field `n`; empty if none are missing."""
        if not pending.arrival.joined:
            self.held_by = 0
        first_n, entries = n - step.fields + 1, list[LedgerEntry]()
        for count, reason in self._each(pending, step, time_ns):
            if count:
                entries.append(never_came(first_n, count, reason))
                first_n += count
        return tuple(entries)

    def _each(self, pending: Pending, step: Step, time_ns: int) -> Iterator[tuple[int, str]]:
        lost, by_computer, standstill, is_clear = step.fields - 1, 0, pending.standstill, True
        gap = NO_SIGNAL if pending.no_signal else _gap(pending, step)
        if standstill is not None:
            by_computer, is_clear = self._arrivals.lost_to_full_buffers(pending.arrival, time_ns, lost)
        found = self._of_driver(pending, lost, time_ns)
        if found is not None and found[0] > by_computer:
            by_computer, standstill, is_clear = found
        if pending.interruption or standstill is None:
            yield lost, pending.interruption or gap
            return
        # A field without a signal says nothing of those that were lost while it waited.
        is_clear = is_clear and not pending.no_signal
        yield by_computer, standstill if is_clear else f"{UNCLEAR}: {gap}, or {standstill}"
        yield lost - by_computer, gap

    def _of_driver(self, pending: Pending, lost: int, time_ns: int) -> tuple[int, str, bool] | None:
        """Fields lost while the driver stood still as well, why, and false if it is one cause of several."""
        self._blamed.intersection_update(pending.of_driver)
        found = [
            self._of_one(stood, lost, time_ns, held=pending.may_be_held and i == 0)
            for i, stood in enumerate(pending.of_driver)
            if stood not in self._blamed
        ]
        fitting = [one for one in found if one is not None]
        return max(fitting, default=None, key=lambda one: (one[0], one[2]))

    def _of_one(
        self, stood: Standstill, lost: int, time_ns: int, *, held: bool
    ) -> tuple[int, str, bool] | None:
        """The same of one standstill; `held`: true if it was right before the field."""
        in_turn, due = self._arrivals.in_turn, stood.time_ns / self._pace.period_ns
        first, last = self._arrivals.would_have_come(time_ns, lost, stood.ended_ns)
        within = lost - max(math.ceil(last - in_turn - _OF_STANDSTILL), 0)  # the others began after it
        shortest = due - in_turn if held else max(due - 1, _LONG)
        is_of_driver = isinstance(stood, StandstillOfDriver) or stood.time_ns > self._buffered_ns
        if is_of_driver and first <= _OF_STANDSTILL and within >= shortest - _OF_STANDSTILL:
            self._blamed.add(stood)
            # Its own buffer may have been held up, and stamped afterwards: then they are missing behind.
            self.held_by = lost if held else self.held_by
            # As well as one that had begun before it. If more are missing, it explains none of them surely.
            by_it = min(within, (math.ceil(due / in_turn) + 1) * in_turn)
            return by_it, stood.reason, lost == by_it
        # It stood still for a part of that time, or they were lost on the bus meanwhile.
        may_be = within >= _LONG and -due <= first <= _OF_STANDSTILL
        return (within, stood.reason, False) if may_be else None


def _gap(pending: Pending, step: Step) -> str:
    if pending.time_ns is not None and step.late is not None and abs(step.late) <= 0.5:
        return TIME_GAP
    if pending.count == step.fields:
        return SEQUENCE_GAP
    by_parity = pending.time_ns is None and pending.phase is not None
    return REPEATED_PARITY if by_parity else TIME_GAP


def doubtful(lost: tuple[LedgerEntry, ...], uncertain_by: int) -> tuple[LedgerEntry, ...]:
    """The same entries if it is uncertain whether the fields are missing: then the cable is not blamed.
    An interruption and a busy computer are known independently, whatever the number of lost fields.
    """
    reason = f"{UNCERTAIN} {uncertain_by}"
    return tuple(one._replace(reason=reason) if one.reason in GAPS else one for one in lost)
