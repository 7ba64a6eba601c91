"""Times of fields and of events by the clock of the Lab Streaming Layer."""

import time
from collections.abc import Callable
from datetime import datetime
from typing import NamedTuple

from grabberd.documents.points_frame import PointsFrame

TRIALS = 9
"""The clocks are read so often; the reading that took the shortest time counts."""
SAME_NS = 10_000_000
"""On one computer, UTC and the monotonic clock differ by the same for everybody, to well within this.

On two computers they do so only if both were started within this time of each other."""


class Relation(NamedTuple):
    """LSL's clock as seen by another one.

    Attributes:
        offset_ns: To be added to the other clock's time.
        error_ns: The most by which that is wrong.
    """

    offset_ns: int
    error_ns: int


class LslClock:
    """Relates the clocks of this computer to LSL's `local_clock`.

    On Linux that is CLOCK_MONOTONIC itself. It is measured nevertheless, because LSL promises it nowhere;
    where no difference can be measured, there is none, and times stay as they are.

    Args:
        local_clock: LSL's clock, seconds.
        monotonic_ns: CLOCK_MONOTONIC of this computer.
        utc_ns: UTC of this computer, since 1970.
    """

    def __init__(
        self,
        local_clock: Callable[[], float],
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        utc_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._local_clock = local_clock
        self._monotonic_ns = monotonic_ns
        self._utc_ns = utc_ns
        measured = _relation(local_clock, monotonic_ns)
        self.monotonic = measured._replace(offset_ns=0) if _is_same(measured) else measured

    def is_of_this_computer(self, frame: PointsFrame) -> bool:
        """True if the monotonic clock that a field was dated by is this computer's."""
        own_ns = self._utc_ns() - self._monotonic_ns()
        return abs(frame.utc_us * 1000 - frame.time_ns - own_ns) < SAME_NS

    def time_of(self, frame: PointsFrame, *, of_this_computer: bool) -> float:
        """Middle of a field's exposure, seconds of LSL's clock.

        Args:
            frame: The field.
            of_this_computer: False: by UTC, as well as the clocks of both computers are set.
        """
        if of_this_computer:
            return (frame.time_ns + self.monotonic.offset_ns) / 1e9
        return self._by_utc(frame.utc_us * 1000)

    def time_at(self, utc: datetime) -> float:
        """A moment of UTC, seconds of LSL's clock."""
        return self._by_utc(round(utc.timestamp() * 1e9))

    def now(self) -> float:
        """The present moment, seconds of LSL's clock."""
        return self._local_clock()

    def _by_utc(self, utc_ns: int) -> float:
        # Related anew every time: UTC may have been set meanwhile.
        return (utc_ns + _relation(self._local_clock, self._utc_ns).offset_ns) / 1e9


def _relation(local_clock: Callable[[], float], other_ns: Callable[[], int]) -> Relation:
    trials = []
    for _ in range(TRIALS):
        before_ns, local_s, after_ns = other_ns(), local_clock(), other_ns()
        middle_ns = (before_ns + after_ns) // 2
        trials.append(Relation(round(local_s * 1e9) - middle_ns, (after_ns - before_ns) // 2))
    return min(trials, key=lambda one: one.error_ns)


def _is_same(relation: Relation) -> bool:
    # LSL's clock comes as a float of seconds: after a year, its steps are of 4 ns.
    return abs(relation.offset_ns) <= relation.error_ns + 1000
