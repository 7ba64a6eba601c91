"""Start of a stream: how late its first field may be, while there is nothing to compare it with."""

import math
from statistics import median

from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.arrivals import Arrivals, Way
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Paths
from grabberd.instrument.acquisition.numbering.pending import Pending

_LATE = 0.75
"""Periods by which the first stamp may be late before the stream begins with a better one."""
_AT_ONCE = 1.5
"""Periods after the request within which a first field has not waited."""
_MARGIN = 1
"""Fields that may be exposed while a stream begins, beside those in the driver's buffers."""


class StreamStart:
    """Fields that a stream begins with, kept back until it is known how late the first one was.

    A stamp may be the time of an arrival, and on an overloaded computer every field waits, each for another
    time. What shows it are stamps that come regularly, or fields that come by the same shortest way, one by
    one; or stamps that vary against the arrivals, which are those of exposures.

    Args:
        info: The stream as granted.
        arrivals: Those of the stream.
        since_ns: When the stream was asked for: nothing was exposed before. None if unknown.
        most: Fields that are kept back at most.
        pace: Of the camera.

    Attributes:
        fields: Those that are kept back, the first of the stream first.
    """

    def __init__(
        self, info: StreamInfo, arrivals: Arrivals, since_ns: int | None, most: int, pace: Pace
    ) -> None:
        self._pace = pace
        self._waits = info.live and not info.waits_for_reader
        self._arrivals = arrivals
        self._paths = Paths(None, Way())
        self._since_ns = since_ns
        self._buffered = info.buffers
        self._most = most
        self.fields: list[Pending] = []

    def add(self, pending: Pending) -> None:
        """Keep back the next field."""
        self.fields.append(pending)
        if len(self.fields) == 1:
            arrival = self._steps_to(pending.arrival.time_ns)
            way = Way() if arrival is None else Way().after(arrival)
            self._paths = Paths(pending.phase, way, exact=not self._waits)
        else:
            stamp, arrival = self._steps_to(pending.time_ns), self._steps_to(pending.arrival.time_ns)
            self._paths.see(pending.seen(stamp, arrival))

    @property
    def is_over(self) -> bool:
        """True if nothing more is to be learned, or the fields have waited for as long as they may."""
        return self.is_known or len(self.fields) > self._most

    @property
    def is_known(self) -> bool:
        """True if it is known how late the first field was."""
        if not self._waits or self.fields[0].arrival.time_ns is None or self._arrivals.tells_of_stamps:
            return True
        return self._longest_wait < _AT_ONCE or self._paths.best.way.is_known or self._stamps_are_regular

    @property
    def _stamps_are_regular(self) -> bool:
        """True if stamps lie on the grid of the rate: no fields have waited then, however they arrived."""
        regular = Way().after(0.0)
        for field, step in zip(self.fields[1:], self._paths.best.steps, strict=True):
            if step.late is None:
                return False
            regular = regular.after(step.late, joined=field.arrival.joined)
        return regular.is_known

    @property
    def late_ns(self) -> int:
        """Time by which the first stamp was late."""
        late = [0.0, *(step.late for step in self._paths.best.steps if step.late is not None)]
        late = [one for one in late if -one <= self._longest_wait]
        if min(late) > -_LATE:
            return 0
        return round(-median(one for one in late if one < min(late) + _LATE) * self._pace.period_ns)

    @property
    def may_be_late_by(self) -> int:
        """Number of fields by which the first one may have been late."""
        return math.ceil(self._longest_wait)

    @property
    def _time_ns(self) -> int:
        first = self.fields[0]
        return first.time_ns or first.arrival.time_ns or first.stamp_ns

    @property
    def _longest_wait(self) -> float:
        """Periods for which the first field can have waited at most."""
        asked = self._steps_to(self._since_ns)
        # A stamp from before the request is one of another clock.
        return self._buffered + _MARGIN if asked is None or asked > 1 else max(-asked, 0.0)

    def _steps_to(self, time_ns: int | None) -> float | None:
        return None if time_ns is None else (time_ns - self._time_ns) / self._pace.period_ns
