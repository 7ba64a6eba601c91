"""Settling: when the oldest pending field has its number, and how much doubt is left then."""

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import islice
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.numbering.arrivals import Arrivals
from grabberd.instrument.acquisition.numbering.losses import uncounted
from grabberd.instrument.acquisition.numbering.paths import Paths, Step
from grabberd.instrument.acquisition.numbering.pending import Pending

_LATE = 0.75
"""Periods by which the stamp of a field in time may be late; where parity does not tell, half a period."""
_AS_MANY = 0.6
"""Periods within which a field is late by a number of fields."""
_TELLING = 6
"""Buffers that have to arrive in time after a loss that nobody counts: else the program may be late."""


class Doubt(NamedTuple):
    """Doubt about the number of one field.

    Attributes:
        fields: Number of fields that it may be off by.
        of_loss: True if it is in doubt whether any are missing at all.
        of_place: True if as many are missing in any case, and only their place is in doubt.
    """

    fields: int
    of_loss: bool = False
    of_place: bool = False


class Settling:
    """Decides by the paths whether the oldest pending field is settled.

    The number of a late field may change until one that is in time, its *anchor*, shows whether any are
    missing. So both are settled together with those between them, and share what doubt there is: what is
    missing may belong before or after a late field.

    Args:
        arrivals: Those of the stream.
        order: Order of the fields. Those of one buffer arrive together, and tell as much as one alone.
        has_own_pace: True if the camera may deliver fewer fields than granted, which looks like losses.
    """

    def __init__(self, arrivals: Arrivals, order: FieldOrder, *, has_own_pace: bool = False) -> None:
        self._arrivals = arrivals
        self._has_own_pace = has_own_pace
        self._latest = _LATE if order.has_parity else 0.5
        self._telling = _TELLING * (2 if order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1)
        self._linked = self._doubt_linked = self._doubt_of_anchor = 0
        self._of_place = False

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
        return anchor is not None and paths.settled(anchor + 1) and self._links(pending, paths, anchor)

    def _links(self, pending: Collection[Pending], paths: Paths, anchor: int) -> bool:
        """True if the oldest field and those up to its anchor are settled together; notes their doubt."""
        steps, in_turn = paths.best.steps, list(islice(pending, len(paths.best.steps)))
        lost = sum(uncounted(one, step) for one, step in zip(in_turn[: anchor + 1], steps, strict=False))
        if lost and paths.best.way.is_known and not _is_met(in_turn[anchor:], steps[anchor:]):
            return False
        if lost and self._arrivals.tells_of_stamps and not _is_there(in_turn[anchor], steps[anchor]):
            # Its stamp alone tells of a loss: that of another clock would as well.
            self._doubt_of_anchor = lost
        after = range(anchor + 1, min(anchor + 1 + self._telling, len(steps)))
        if lost and (self._has_own_pace or not self._arrivals.tells_of_stamps):
            if len(after) < self._telling:
                return False
            told = all(
                steps[i].arrived_in_time and in_turn[i].in_time and not uncounted(in_turn[i], steps[i])
                for i in after
            )
            self._doubt_of_anchor = 0 if told else lost
        self._linked = anchor + 1
        exchanged = _exchanged(in_turn[:anchor], steps[: anchor + 1])
        self._doubt_linked = max(lost if anchor else 0, exchanged, self._doubt_of_anchor)
        self._of_place = not self._doubt_of_anchor
        return True

    def settle_next(self, oldest: Pending, paths: Paths) -> Doubt:
        """Note that the oldest field is about to be settled; returns the doubt about it."""
        if not self._linked:
            return self._unsettled(oldest, paths)
        self._linked -= 1
        if self._linked:
            return Doubt(self._doubt_linked, not self._of_place, self._of_place)
        doubt, self._doubt_of_anchor = self._doubt_of_anchor, 0
        return Doubt(doubt, of_loss=doubt > 0)

    def _unsettled(self, oldest: Pending, paths: Paths) -> Doubt:
        """Doubt about a field whose number has to be settled before later ones have told of it."""
        lost = uncounted(oldest, paths.best.steps[0])
        in_doubt = lost > 0 and oldest.arrival.time_ns is not None and not self._arrivals.tells_of_stamps
        return Doubt(max(self._spread(paths), lost * in_doubt), of_loss=in_doubt)

    def _spread(self, paths: Paths) -> int:
        """Number of fields by which one may be off whose number is settled before it is certain."""
        step = paths.best.steps[0]
        if step.arrived is None or self._in_time(step):
            return 0 if paths.settled() else paths.spread
        return max(paths.spread, math.ceil(step.arrived))

    def _in_time(self, step: Step) -> bool:
        return step.arrived_in_time or (step.late is not None and abs(step.late) <= self._latest)


def _is_there(pending: Pending, step: Step) -> bool:
    """True if a field has arrived in time, or its arrival tells nothing."""
    return step.arrived is None or (step.arrived_in_time and pending.in_time)


def _is_met(pending: Iterable[Pending], steps: Sequence[Step]) -> bool:
    """True if one of the fields has come in time by itself: those of a queue that is being emptied agree with
    one another, and with a clock that was set meanwhile.
    """
    return any(
        step.arrived_in_time and one.in_time and not one.arrival.burst
        for one, step in zip(pending, steps, strict=False)
    )


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
