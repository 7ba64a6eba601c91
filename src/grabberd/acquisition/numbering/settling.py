"""Settling: when the oldest pending field has its number, and how much doubt is left then."""

import math
from collections.abc import Collection, Sequence
from itertools import islice

from grabberd.acquisition.device import FieldOrder
from grabberd.acquisition.numbering.arrivals import Arrivals
from grabberd.acquisition.numbering.losses import uncounted
from grabberd.acquisition.numbering.paths import Paths, Step
from grabberd.acquisition.numbering.pending import Pending

_LATE = 0.75
"""Periods by which the stamp of a field in time may be late; where parity does not tell, half a period."""
_AS_MANY = 0.6
"""Periods within which a field is late by a number of fields."""
_TELLING = 6
"""Buffers that have to arrive in time after a loss that nobody counts: else the program may be late."""


class Settling:
    """Decides by the paths whether the oldest pending field is settled.

    The number of a late field may change until one that is in time, its *anchor*, shows whether any are
    missing. So both are settled together with those between them, and share what doubt there is: what is
    missing may belong before or after a late field.

    Args:
        arrivals: Those of the stream.
        order: Order of the fields. Those of one buffer arrive together, and tell as much as one alone.
    """

    def __init__(self, arrivals: Arrivals, order: FieldOrder) -> None:
        self._arrivals = arrivals
        self._latest = 0.5 if order is FieldOrder.ONE_PARITY else _LATE
        self._telling = _TELLING * (2 if order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1)
        self._linked = self._doubt_linked = self._doubt_of_anchor = 0

    def is_settled(self, pending: Collection[Pending], paths: Paths) -> bool:
        """True if the oldest field's number will not change any more."""
        if self._linked:
            return True
        if not paths.settled():
            return False
        if next(iter(pending)).arrival.time_ns is None:
            return True
        steps = paths.best.steps
        anchor = next((i for i, step in enumerate(steps) if self._in_time(step)), None)
        if anchor is None or not paths.settled(anchor + 1):
            return False
        in_turn = zip(islice(pending, anchor + 1), steps, strict=False)
        lost = sum(uncounted(one, step) for one, step in in_turn)
        after = steps[anchor + 1 : anchor + 1 + self._telling]
        if lost and not self._arrivals.tells_of_stamps:
            if len(after) < self._telling:
                return False
            self._doubt_of_anchor = 0 if all(one.arrived_in_time for one in after) else lost
        self._linked = anchor + 1
        exchanged = _exchanged(tuple(islice(pending, anchor)), steps[: anchor + 1])
        self._doubt_linked = max(lost if anchor else 0, exchanged, self._doubt_of_anchor)
        return True

    def settle_next(self, paths: Paths) -> int:
        """Note that the oldest field is about to be settled; returns the fields that it may be off by."""
        if not self._linked:
            return self._spread(paths)
        self._linked -= 1
        if self._linked:
            return self._doubt_linked
        doubt, self._doubt_of_anchor = self._doubt_of_anchor, 0
        return doubt

    def _spread(self, paths: Paths) -> int:
        """Number of fields by which one may be off whose number is settled before it is certain."""
        step = paths.best.steps[0]
        if step.arrived is None or self._in_time(step):
            return 0 if paths.settled() else paths.spread
        return max(paths.spread, math.ceil(step.arrived))

    def _in_time(self, step: Step) -> bool:
        return step.arrived_in_time or (step.late is not None and abs(step.late) <= self._latest)


def _exchanged(late: Sequence[Pending], steps: Sequence[Step]) -> int:
    """Number of fields lost after a late one, up to its anchor, that may as well be lost before it.

    They may if it is late by as many: then it came in time, and the driver has counted wrongly. A field that
    has waited in a buffer with others is late for that reason.
    """
    after = [sum(step.fields - 1 for step in steps[i + 1 :]) for i in range(len(late))]
    return max(
        (
            lost
            for one, step, lost in zip(late, steps, after, strict=False)
            if lost and not one.arrival.burst and _is_late_by(lost, step)
        ),
        default=0,
    )


def _is_late_by(fields: int, step: Step) -> bool:
    periods = step.arrived if step.arrived is not None else step.late
    return periods is not None and abs(periods - fields) < _AS_MANY
