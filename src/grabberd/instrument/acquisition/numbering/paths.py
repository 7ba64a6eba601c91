"""Hypotheses about the latest fields: how many nominal steps each is after the previous one.

A path is one way to number the pending fields. Its cost is the negative log likelihood in nats, up to a
constant: the sum over its fields of everything that must be explained by errors. Time is one-sided evidence:
a stamp or an arrival may be late by any amount, but hardly early. So a path that claims too many losses is
refuted by the next field that is on time.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from grabberd.instrument.acquisition.numbering.arrivals import Way

_JITTER = 0.25
"""σ of a stamp in periods if it is neither late nor wrong."""
_EXACT_JITTER = 0.1
"""The same for recordings, whose times are smoothed."""
_EARLY_ARRIVAL = 0.6
"""Periods by which a field may arrive sooner than the quickest one did."""
_SHORTER_WAY, _MORE = 2.0, 3.0
"""Cost of a field that arrives sooner than all others, by any amount, while the shortest way is unknown: the
computer was overloaded until then; plus an amount for each field that came regularly before."""
_QUEUED = 64
"""Periods by which no queue makes the first field of a stream late: drivers have 32 buffers of a frame."""
_ARRIVAL = 0.5
"""Weight of an arrival's lateness relative to that of a stamp."""
_COMPARED = 0.1
"""Changes of the lateness that are ignored, in periods."""
_LATE = 4.0
"""Cost of a field that falls behind: something was busy."""
_STILL_LATE, _LATE_AGAIN = 0.7, 3.0
"""Cost of one that is still late: a queue drains; if it does not, another grid is more likely."""
_LATE_UNKNOWN = 1.5
"""Highest cost of both while no way is known and stamps may be arrivals, plus 1 for each field that came
regularly before: on an overloaded computer all are late."""
_LOSS = 3.5
"""Cost of a loss; `_COUNTED` for one counted by the driver."""
_COUNTED = 1.0
_MISCOUNT = 7.0
"""Cost of a step that the driver's count contradicts."""
_WRONG_PARITY, _TURN = 9.0, 11.0
"""Cost of a field of the wrong parity, i.e. of a camera that continues in the other phase."""
_IN_A_BURST = 3.0
"""Cost of a loss before a field that waited in a buffer with the previous one: buffers fill before fields are
lost."""
_OTHER_CLOCK, _STILL_OTHER = 10.0, 1.0
"""Cost of a stamp that is early by any amount, since the clock was set back, and of the next one as early."""
_SAME_CLOCK = 0.5
"""Cost of a stamp that is still as far off as one that arrived in time."""
_FAR = 40.0
"""Highest cost of time: no path becomes so unlikely that no evidence could save it."""
_BEAM, _WIDTH = 12, 25.0
"""Number of paths that are kept, and by how much they may be worse than the best."""
_HARDLY_WORSE = 3.0
"""Difference of cost up to which a worse path may be the right one."""
CERTAIN = 8.0
"""A step is settled if every path without it is less likely by a factor of three thousand."""


class Seen(NamedTuple):
    """Evidence of a field, in periods after the last settled field.

    Attributes:
        stamp: by its timestamp; None if that is not trusted.
        arrival: by its arrival, before its way is taken off; None if unknown.
        stamped_on_arrival: true if the stamp may be the time of the arrival.
        counted: step by the driver's count; None if unknown.
        parity: of the field; None if all have the same.
        burst: true if it arrived with the one before, and not a period after it.
        joined: true if it came in one buffer with the one before: nothing is lost between them.
        excused: true if losses before it have a known reason.
        waited: true if it may have waited for the program.
    """

    stamp: float | None
    arrival: float | None
    stamped_on_arrival: bool
    burst: bool
    joined: bool
    counted: int | None
    parity: int | None
    excused: bool
    waited: bool


class Step(NamedTuple):
    """One field of a path.

    Attributes:
        fields: nominal steps from the field before.
        late: periods after its time by its stamp, `arrived` by its arrival; None where unknown.
        wrong_parity: true if the parity is another one than the path expects.
        other_clock: true if its stamp was as far off as the one before, which arrived in time.
        doubt: number of fields by which another, hardly worse path differed there but agreed later.
    """

    fields: int
    late: float | None
    arrived: float | None
    wrong_parity: bool = False
    other_clock: bool = False
    doubt: int = 0

    @property
    def arrived_in_time(self) -> bool:
        """True if the field came by the shortest way."""
        return self.arrived is not None and abs(self.arrived) < _EARLY_ARRIVAL


class Path(NamedTuple):
    """A way to number the pending fields.

    Attributes:
        cost: of all of it.
        steps: of the pending fields, the oldest first.
        ahead: their sum.
        parity: of the newest field as expected; None before the first.
        way: shortest way of a field so far.
    """

    cost: float
    steps: tuple[Step, ...]
    ahead: int
    parity: int | None
    way: Way


class Paths:
    """The paths that are still possible; at first only the settled one.

    Args:
        parity: Of the first field; None if all have the same.
        way: From its exposure to its arrival.
        exact: True for the times of a recording, none of which is late.
    """

    def __init__(self, parity: int | None, way: Way, *, exact: bool = False) -> None:
        self._exact = exact
        self._paths = [Path(0.0, (), 0, parity, way)]
        self._least_way = min(way.periods, 0.0)
        self._last = Step(1, 0.0, 0.0)

    @property
    def best(self) -> Path:
        """The most likely path."""
        return self._paths[0]

    @property
    def spread(self) -> int:
        """Number of fields by which the possible paths differ."""
        ahead = [path.ahead for path in self._possible()]
        return max(ahead) - min(ahead)

    def see(self, seen: Seen) -> None:
        """Continues every path by a field."""
        found: dict[tuple[int, int | None], Path] = {}
        for path in self._paths:
            for longer in self._continued(path, seen):
                key = longer.ahead, longer.parity
                found[key] = _merged(found[key], longer) if key in found else longer
        paths = sorted(found.values(), key=lambda path: path.cost)
        self._paths = [path for path in paths[:_BEAM] if path.cost < paths[0].cost + _WIDTH]

    def settled(self, fields: int = 1) -> bool:
        """True if all possible paths begin with the same steps of so many fields."""
        if len(self._paths) == 1:
            return True
        best = self.best.steps
        return all(_same(path.steps[i], best[i]) for path in self._possible() for i in range(fields))

    def settle(self) -> Step:
        """Takes the oldest step of the best path, and drops the paths without it."""
        first = self.best.steps[0]
        least = self.best.cost
        self._last = first
        self._paths = [
            Path(path.cost - least, path.steps[1:], path.ahead - first.fields, path.parity, path.way)
            for path in self._paths
            if _same(path.steps[0], first)
        ]
        return first

    def lengthen_way(self, periods: float) -> None:
        """Note that all exposures so far were earlier by an amount."""
        self._paths = [path._replace(way=path.way.longer_by(periods)) for path in self._paths]

    def take_way(self, way: Way) -> None:
        """Note that only this one is known, of all that the fields seemed to come by."""
        self._paths = [path._replace(way=way) for path in self._paths]

    def confirm_way(self, way: Way) -> None:
        """Note the shortest way of the fields whose numbers are certain."""
        self._paths = [
            path._replace(way=way) if path.way.is_far_longer_than(way.periods) else path
            for path in self._paths
        ]
        self._least_way = min(way.periods, 0.0)

    def _possible(self) -> Iterator[Path]:
        return (path for path in self._paths if path.cost < self.best.cost + CERTAIN)

    def _continued(self, path: Path, seen: Seen) -> Iterator[Path]:
        before = path.steps[-1] if path.steps else self._last
        for fields in _steps(path, seen):
            ahead = path.ahead + fields
            late, arrived = _after(seen.stamp, ahead), _after(_exposed(path, seen), ahead)
            # No field is lost out of a queue.
            counted = seen.burst and seen.counted == fields
            other_clock = _by_another_clock(late, before, counted=counted)
            step = Step(fields, late, arrived, other_clock=other_clock)
            time = self._cost_of_time(step, before, seen, path.way)
            cost = path.cost + _cost_of_loss(fields, seen) + time
            way = path.way if seen.arrival is None else _way(path.way, seen.arrival - ahead, seen)
            expected = None if path.parity is None else (path.parity + fields) % 2
            if seen.parity is None or expected in (None, seen.parity):
                yield Path(cost, (*path.steps, step), ahead, seen.parity, way)
                continue
            wrong = step._replace(wrong_parity=True)
            yield Path(cost + _WRONG_PARITY, (*path.steps, wrong), ahead, expected, way)
            turned = cost + (0.0 if seen.excused else _TURN)
            yield Path(turned, (*path.steps, step), ahead, seen.parity, way)

    def _cost_of_time(self, step: Step, before: Step, seen: Seen, way: Way) -> float:
        if self._exact:
            return _cost_of_exact_time(step)
        cost = _cost_of_time(step, before, seen, way)
        if step.arrived is None:
            return cost
        # No field comes before it is exposed, however many seem to, unless their clock is ahead anyway.
        too_short = min(step.arrived + way.periods - self._least_way, 0.0)
        return cost + min(_cost_of_lateness(too_short, 0.0), _FAR)


def _merged(one: Path, other: Path) -> Path:
    """The better of two paths that lead to the same place, with their difference on the way."""
    better, worse = (one, other) if one.cost <= other.cost else (other, one)
    if worse.cost > better.cost + _HARDLY_WORSE:
        return better
    steps, apart = [], 0
    for step, another in zip(better.steps, worse.steps, strict=True):
        apart += step.fields - another.fields
        steps.append(step._replace(doubt=max(step.doubt, another.doubt, abs(apart))))
    return better._replace(steps=tuple(steps))


def _same(one: Step, other: Step) -> bool:
    return (one.fields, one.wrong_parity) == (other.fields, other.wrong_parity)


def _by_another_clock(late: float | None, before: Step, *, counted: bool) -> bool:
    if late is None or before.late is None or abs(late) <= _EARLY_ARRIVAL:
        return False
    in_time = before.arrived is not None and abs(before.arrived) <= _EARLY_ARRIVAL
    return (in_time or before.other_clock or counted) and abs(late - before.late) <= _JITTER


def _way(before: Way, periods: float, seen: Seen) -> Way:
    """The shortest way of a path after one more field.

    A known way is not given up for a field whose number may be wrong.
    """
    stays = before.is_known and before.is_far_longer_than(periods)
    return before if stays else before.after(periods, joined=seen.joined or seen.burst, waited=seen.waited)


def _exposed(path: Path, seen: Seen) -> float | None:
    """Exposure of a field that came by the shortest way known on a path."""
    if seen.arrival is None or math.isinf(path.way.periods):
        return None
    return seen.arrival - path.way.periods


def _after(periods: float | None, ahead: int) -> float | None:
    return None if periods is None else periods - ahead


def _steps(path: Path, seen: Seen) -> set[int]:
    """The steps worth trying."""
    if seen.joined:
        return {1}
    steps = {1, 2}
    for periods in (seen.stamp, _exposed(path, seen)):
        if periods is not None:
            nearest = round(periods - path.ahead)
            steps |= {nearest - 1, nearest, nearest + 1}
    if seen.counted is not None:
        steps.add(seen.counted)
    return {step for step in steps if step > 0}


def _cost_of_loss(fields: int, seen: Seen) -> float:
    contradicted = seen.counted is not None and seen.counted != fields
    if fields == 1 or seen.excused:
        return _MISCOUNT if contradicted and not seen.excused else 0.0
    if seen.counted == fields:
        return _COUNTED
    return _LOSS + (_MISCOUNT if contradicted else 0.0) + (_IN_A_BURST if seen.burst else 0.0)


def _cost_of_exact_time(step: Step) -> float:
    return 0.0 if step.late is None else min(0.5 * (step.late / _EXACT_JITTER) ** 2, _FAR)


def _cost_of_a_shorter_way(way: Way, seen: Seen) -> float:
    """Highest cost of a field that arrives sooner than all before."""
    if way.is_known:
        return _FAR
    # A draining queue delivers its fields one by one, each a period sooner than the previous one.
    return _STILL_LATE if seen.burst else _SHORTER_WAY + _MORE * way.regular


def _cost_of_time(step: Step, before: Step, seen: Seen, way: Way) -> float:
    cost = 0.0
    if step.late is not None:
        stamp = _SAME_CLOCK if step.other_clock else _cost_of_stamp(step.late, before.late or 0.0)
        if seen.stamped_on_arrival and not way.is_known:
            # An early one is only early because those before it were late.
            stamp = min(stamp, _LATE_UNKNOWN + way.regular) if step.late > 0 else 0.0
        cost += stamp
    if step.arrived is not None:
        lateness = _cost_of_lateness(step.arrived, before.arrived or 0.0)
        # A way cannot be negative.
        if step.arrived < 0 and step.arrived + way.periods > -_JITTER:
            lateness = min(lateness, _cost_of_a_shorter_way(way, seen))
        if seen.excused and step.arrived > _QUEUED:
            return _FAR
        # A stream that has just restarted has no queue in which its first field could have become late. While
        # no way is known, that is no evidence beside the stamps, from which the way comes.
        if (seen.excused and way.is_known) or step.late is None or step.arrived < -_EARLY_ARRIVAL:
            cost += lateness
        # Else both are late for the same reason. While no way is known, only falling behind is evidence.
        elif abs(step.arrived - step.late) > _EARLY_ARRIVAL and (
            way.is_known or step.arrived > (before.arrived or 0.0) + _COMPARED
        ):
            cost += _ARRIVAL * lateness
    return min(cost, _FAR)


def _cost_of_stamp(late: float, before: float) -> float:
    cost = _cost_of_lateness(late, before)
    if late > 0:
        return cost
    return min(cost, _STILL_OTHER if abs(late - before) < _COMPARED else _OTHER_CLOCK)


def _cost_of_lateness(late: float, before: float) -> float:
    usual = 0.5 * (late / _JITTER) ** 2
    if late <= 0:
        return usual
    if late > before + _COMPARED:
        return min(usual, _LATE + 0.5 * float(np.log1p(late)))
    return min(usual, _STILL_LATE if late < before - _COMPARED else _LATE_AGAIN)
