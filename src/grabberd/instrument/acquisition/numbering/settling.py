"""Settling: when the number of the oldest pending field is final, and which doubt remains.

A doubt lasts from a field with an uncertain number until the next one with a certain number.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import islice
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.numbering.arrivals import Arrival, Arrivals
from grabberd.instrument.acquisition.numbering.paths import Paths, Step
from grabberd.instrument.acquisition.numbering.pending import Pending, is_held_up, uncounted
from grabberd.instrument.acquisition.numbering.timing import Timing

_LATE = 0.75
"""Periods by which the stamp of a field in time may be late; half a period if parity is unknown."""
_AS_MANY = 0.6
"""Tolerance in periods within which a field is late by a whole number of fields."""
_CONFIRMING = 6
"""Buffers that must arrive in time after a loss that is not counted: else the program may be late."""


class Doubt(NamedTuple):
    """Doubt about the number of one field.

    Attributes:
        fields: Number of fields that it may be off by.
        of_loss: True if it is in doubt whether any are missing at all.
        of_place: True if the number of missing fields is certain, and only their place is in doubt.
    """

    fields: int
    of_loss: bool = False
    of_place: bool = False


class Settling:
    """Decides by the paths whether the oldest pending field is settled.

    The number of a late field may change until one that is in time, its *anchor*, shows whether any are
    missing. So both are settled together with those between them, and share the doubt: missing fields may
    belong before or after a late field.

    Args:
        arrivals: Those of the stream.
        order: Order of the fields. Those of one buffer arrive together, and are as much evidence as one.
        has_own_pace: True if the camera may deliver fewer fields than granted, which looks like losses.
    """

    def __init__(self, arrivals: Arrivals, order: FieldOrder, *, has_own_pace: bool = False) -> None:
        self._arrivals = arrivals
        self._has_own_pace = has_own_pace
        self._latest = _LATE if order.has_parity else 0.5
        self._needed = _CONFIRMING * (2 if order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST) else 1)
        self._linked = self._doubt_linked = self._doubt_of_anchor = 0
        self._of_place = False

    def is_settled(self, pending: Collection[Pending], paths: Paths) -> bool:
        """True if the oldest field's number is final."""
        if self._linked:
            return True
        if not paths.settled():
            return False
        if next(iter(pending)).arrival.time_ns is None:
            return True
        steps = paths.best.steps
        in_time = (self._in_time(one, step, paths) for one, step in zip(pending, steps, strict=False))
        anchor = next((i for i, is_in_time in enumerate(in_time) if is_in_time), None)
        return anchor is not None and paths.settled(anchor + 1) and self._links(pending, paths, anchor)

    def _links(self, pending: Collection[Pending], paths: Paths, anchor: int) -> bool:
        """True if the oldest field and those up to its anchor are settled together; notes their doubt."""
        steps, in_turn = paths.best.steps, list(islice(pending, len(paths.best.steps)))
        lost = sum(uncounted(one, step) for one, step in zip(in_turn[: anchor + 1], steps, strict=False))
        if lost and paths.best.way.is_known and not _is_met(in_turn[anchor:], steps[anchor:]):
            return False
        if lost and self._arrivals.tells_of_stamps and not _is_there(in_turn[anchor], steps[anchor]):
            # Its stamp is the only sign of a loss: a change of the clock would look the same.
            self._doubt_of_anchor = lost
        after = range(anchor + 1, min(anchor + 1 + self._needed, len(steps)))
        if lost and (self._has_own_pace or not self._arrivals.tells_of_stamps):
            if len(after) < self._needed:
                return False
            confirmed = all(
                steps[i].arrived_in_time
                and in_turn[i].in_time
                and not (self._has_own_pace and uncounted(in_turn[i], steps[i]))
                for i in after
            )
            self._doubt_of_anchor = 0 if confirmed else lost
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
        """Doubt about a field whose number must be settled before later ones have confirmed it."""
        lost = uncounted(oldest, paths.best.steps[0])
        in_doubt = lost > 0 and oldest.arrival.time_ns is not None and not self._arrivals.tells_of_stamps
        of_loss = in_doubt or self._is_held_up(oldest, paths.best.steps[0])
        return Doubt(max(self._spread(oldest, paths), lost * in_doubt), of_loss)

    def _spread(self, oldest: Pending, paths: Paths) -> int:
        """Number of fields by which a field may be off if it is settled before its number is certain."""
        step = paths.best.steps[0]
        if step.arrived is None or self._in_time(oldest, step, paths):
            return 0 if paths.settled() else paths.spread
        return max(paths.spread, math.ceil(step.arrived))

    def _in_time(self, pending: Pending, step: Step, paths: Paths) -> bool:
        if step.arrived_in_time:
            return True
        # One that was held up may come after others that were lost, and with a clock that was set meanwhile.
        if step.late is None or (paths.best.way.is_known and self._is_held_up(pending, step)):
            return False
        return abs(step.late) <= self._latest or self._arrivals.ticks_over(step.late)

    def _is_held_up(self, pending: Pending, step: Step) -> bool:
        return is_held_up(pending, step) and not self._arrivals.ticks_over(step.arrived or 0.0)


def _is_there(pending: Pending, step: Step) -> bool:
    """True if a field has arrived in time, or its arrival is no evidence."""
    return step.arrived is None or (step.arrived_in_time and pending.in_time)


def _is_met(pending: Iterable[Pending], steps: Sequence[Step]) -> bool:
    """True if one of the fields came alone and in time: those of a draining queue agree with one another, and
    with a clock that was set meanwhile.
    """
    return any(
        step.arrived_in_time and one.in_time and not one.arrival.burst
        for one, step in zip(pending, steps, strict=False)
    )


def _exchanged(late: Sequence[Pending], steps: Sequence[Step]) -> int:
    """Number of fields lost after a late one, up to its anchor, that may as well be lost before it.

    That is possible if it is late by as many: then it came in time, and the driver has miscounted. A field
    that has waited in a buffer with others is late for that reason.
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


_IN_PHASE = 0.8
"""Periods by which the time of a field may be off while its parity decides: beyond them the camera has turned
unseen."""
_AS_COUNTED = 1.5
"""Periods by which the driver's count may be ahead of a time, which is less exact after a long doubt."""
_RATHER_LATE = 0.15
"""Periods by which the earliest of some fields that arrive in time is rather late than early."""
_REGULAR = 12
"""Consecutive fields that arrive in time without a loss, after which their numbers are certain: late fields
come in a burst, or earlier and earlier."""


class Evidence(NamedTuple):
    """Evidence about a field's number in addition to its step.

    Attributes:
        uncertain_by: Doubt about this field alone.
        way_is_known: False if no field has come by the shortest way yet: then none arrives in time.
        in_time: True if it has arrived in time, as far as is known from its arrival and the program.
        ahead_by: Fields by which numbers have run ahead of the camera, whose clock begins again with this
            one: then matching stamps are no evidence until an arrival confirms them.
        of_loss: True if it is in doubt whether fields are missing before it, for which matching stamps are no
            evidence either.
        stamps_follow: True if the stamps are of another clock from this field on, and shifted to continue
            the numbers as they are, so that they are no evidence of them.
        of_place: True if the doubt is only which of the neighbouring fields was lost.
        stamped: False if its time had to be predicted: then its stamp matches nothing.
        counted: Fields since the previous one by the driver's count; None if unknown.
        turned: True if the camera goes on in the other phase with this one; None if its fields have no phase.
        is_older: True if it was handed over after a later one: the camera has exposed none for its number.
    """

    uncertain_by: int
    way_is_known: bool
    in_time: bool
    ahead_by: int = 0
    of_loss: bool = False
    stamps_follow: bool = False
    of_place: bool = False
    stamped: bool = True
    counted: int | None = None
    turned: bool | None = None
    is_older: bool = False


class Doubts:
    """Range of the possible numbers while one is in doubt.

    Every number is greater than the previous one, and no field was exposed later than its arrival by the
    shortest way allows. So between two certain numbers, the true number of each field is between two bounds.

    Args:
        arrivals: Those of the stream.
        timing: Of the fields, for the period as learned: with the granted one a camera that is 100 ppm off
            would have lost a field after three minutes.

    Attributes:
        open: True from a field whose number is uncertain up to one whose number is certain again.
        too_high_by: Fields by which numbers turn out to be too high from the last field on; negative if they
            are too low, 0 if there is nothing new.
    """

    def __init__(self, arrivals: Arrivals, timing: Timing) -> None:
        self._arrivals = arrivals
        self._timing = timing
        self._certain: tuple[int, int] | None = None
        self._counted: int | None = None
        self.open = self._arrival_decides = self._of_place = False
        self.too_high_by = self._known_too_high = 0
        self._fields = self._in_a_row = self._punctual = 0
        self._least_late = math.inf
        self._keeps_phase = True
        self._learned_ns = timing.period_ns

    @property
    def keeps_phase(self) -> bool:
        """False if the camera seems to have turned since the last certain number."""
        return self._keeps_phase or not self.open

    @property
    def _period_ns(self) -> float:
        """Period of the camera: stamps that may be arrivals teach nothing while they come late."""
        return self._timing.period_ns if self._arrivals.tells_of_stamps else self._learned_ns

    def begin(self, time_ns: int, late_by: int) -> None:
        """Note the time of the first field, and the number of fields by which it may be late."""
        self._certain, self._fields = (-late_by, time_ns - round(late_by * self._period_ns)), 0
        self.open = late_by > 0
        self._counted = None if late_by else 0

    def end_by_count(self, n: int, time_ns: int) -> int:
        """End a doubt by the driver's count alone, since the times until now had another pace.

        Returns:
            The fields by which the numbers turn out to be too high from here on, as `too_high_by`.
        """
        too_high_by = 0
        if self.open and self._certain is not None and self._counted is not None:
            too_high_by = n - self._certain[0] - self._counted - self._known_too_high
        self.open, self._certain = False, (n, time_ns)
        self._fields = self._counted = self._known_too_high = 0
        return too_high_by

    def shift(self, late_ns: int) -> None:
        """Note that all times so far were late by an amount."""
        if self._certain is not None:
            self._certain = self._certain[0], self._certain[1] - late_ns

    def of(self, n: int, time_ns: int, step: Step, arrival: Arrival, evidence: Evidence) -> int:
        """Number of fields by which a field's number may be off.

        Args:
            n: Its number.
            time_ns: Its time.
            step: How it was numbered.
            arrival: Its arrival.
            evidence: Further evidence about its number.
        """
        uncertain_by, way_is_known = evidence.uncertain_by, evidence.way_is_known
        self.too_high_by = evidence.ahead_by
        self._known_too_high += evidence.ahead_by
        self._fields += not evidence.is_older
        counts = self._counted is not None and evidence.counted is not None
        self._counted = (self._counted or 0) + (evidence.counted or 0) if counts else None
        self._keeps_phase = evidence.turned is False and (self._keeps_phase or not self.open)
        in_time = evidence.in_time
        self._punctual = self._punctual + 1 if in_time else 0
        # Those before the doubt, or before a loss, tell nothing of the numbers after it.
        goes_on = in_time and self.open and step.fields == 1
        late_by = self._late_by(n, arrival) if in_time and self.open else math.inf
        self._least_late = min(self._least_late, late_by) if goes_on else late_by
        if self._punctual >= _REGULAR:
            self._learned_ns = self._timing.period_ns
        regular = way_is_known and in_time and step.fields == 1
        self._in_a_row = self._in_a_row + 1 if regular else 0
        stamps_unsure = evidence.ahead_by > 0 or evidence.of_loss or evidence.stamps_follow
        self._arrival_decides = stamps_unsure or (self._arrival_decides and self.open)
        if uncertain_by:
            self._of_place = evidence.of_place and (self._of_place or not self.open)
        in_place = way_is_known and in_time and self._is_where_it_arrived(n, arrival)
        ends = self._ends(step, in_time=in_time, stamped=evidence.stamped) or (in_place and self._of_place)
        was_open, self.open = self.open, uncertain_by > 0 or (self.open and not ends)
        if self.open:
            return max(uncertain_by, self._range(n, time_ns, arrival), 1)
        if was_open:
            self.too_high_by += n - self._true_n(n, time_ns, step, arrival) - self._known_too_high
        self._certain, self._fields, self._known_too_high = (n, time_ns), 0, 0
        self._counted = 0
        return 0

    def _ends(self, step: Step, *, in_time: bool, stamped: bool) -> bool:
        fits = stamped and self._arrivals.tells_of_stamps and step.late is not None and abs(step.late) < 0.5
        fits = fits and (in_time or not self._arrival_decides)
        return fits or self._in_a_row >= _REGULAR or step.arrived is None

    def _true_n(self, n: int, time_ns: int, step: Step, arrival: Arrival) -> int:
        """Number of a field that ends a doubt, counted from the last certain one."""
        if self._certain is None:
            return n
        # By its arrival rather than by the time, which may have followed stamps that are no better.
        latest, (certain_n, certain_ns) = n + self._least_late - _RATHER_LATE, self._certain
        if math.isinf(latest) or not step.arrived_in_time or not self._arrivals.way.is_known:
            latest = certain_n + (time_ns - certain_ns) / self._period_ns
        # A driver may miss a loss, but hardly counts too many.
        if self._counted is not None and -0.5 < certain_n + self._counted - latest < _AS_COUNTED:
            return certain_n + self._counted
        of_same_phase = n + 2 * round((latest - n) / 2)
        return (
            of_same_phase if self._keeps_phase and abs(latest - of_same_phase) < _IN_PHASE else round(latest)
        )

    def _late_by(self, n: int, arrival: Arrival) -> float:
        """Fields by which a number would be too low, had its field come by the shortest way."""
        latest = self._latest(arrival)
        return math.inf if latest is None else latest - n

    def _is_where_it_arrived(self, n: int, arrival: Arrival) -> bool:
        latest = self._latest(arrival)
        return latest is not None and round(latest) == n

    def _latest(self, arrival: Arrival) -> float | None:
        """Greatest number allowed by an arrival, relative to the last certain field."""
        exposed_ns = self._arrivals.exposed_ns(arrival) if self._arrivals.way.is_known else arrival.time_ns
        if exposed_ns is None or self._certain is None:
            return None
        certain_n, certain_ns = self._certain
        return certain_n + (exposed_ns - certain_ns) / self._period_ns

    def _range(self, n: int, time_ns: int, arrival: Arrival) -> int:
        """Number of fields by which number and time of a field may be off."""
        latest = self._latest(arrival)
        if latest is None or self._certain is None:
            return 0
        certain_n, certain_ns = self._certain
        late = (time_ns - certain_ns) / self._period_ns - self._fields
        return max(n - (certain_n + self._fields), round(latest) - n, math.ceil(late))
