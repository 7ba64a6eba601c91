"""Arrivals of a stream's fields: when each came, with which others, and after which delay."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.pace import Pace

_BURST = 0.3
"""Periods between arrivals, below which fields have waited in the driver's buffers."""
_VARIATIONS = 4
"""Changes of the time from stamp to arrival after which it is not constant: setting a clock causes one."""
_REGULAR, _ALIKE = 8, 0.25
"""Number of fields by which those that come by the shortest way, within so many periods, outnumber the later
ones once it is known. While a computer is overloaded every field waits, each for another time."""
_GROWS = 0.001
"""Growth of the shortest way from field to field, in periods: it follows a computer that becomes slower."""


class Way(NamedTuple):
    """Shortest way from a field's exposure to its arrival.

    Attributes:
        periods: Its length; infinite before the first field.
        regular: Number of fields that have come by it, less those that have come later.
    """

    periods: float = math.inf
    regular: int = 0

    @property
    def is_known(self) -> bool:
        """True once fields have come regularly, so that none can come by a much shorter way."""
        return self.regular >= _REGULAR

    def longer_by(self, periods: float) -> "Way":
        """The same, where all exposures turn out to have been so much earlier."""
        return self._replace(periods=self.periods + periods)

    def is_far_longer_than(self, periods: float) -> bool:
        """True if a way of so many periods is much shorter."""
        return periods < self.periods - _ALIKE

    def after(self, periods: float, *, joined: bool = False) -> "Way":
        """The same after one more field, which has come by such a way.

        Fields joined in one buffer are as much evidence as a single one.
        """
        shortest = min(periods, self.periods + _GROWS)
        if self.is_far_longer_than(periods):
            return Way(shortest, 1)
        if self.is_known or joined:  # a known one is not affected by late fields
            return Way(shortest, self.regular)
        in_time = periods < self.periods + _ALIKE
        return Way(shortest, self.regular + 1 if in_time else max(self.regular - 1, 0))


class Arrival(NamedTuple):
    """Arrival of one field.

    Attributes:
        time_ns: Earliest possible time of its arrival; None if that is no evidence.
        burst: True if it came right after the one before.
        joined: True if it came in one buffer with the one before.
    """

    time_ns: int | None
    burst: bool
    joined: bool


class Arrivals:
    """Arrivals, and the shortest way from a field's exposure to its arrival.

    Args:
        info: The stream as granted. Fields of a recording, and of a source that waits for its reader, arrive
            whenever they are taken.
        pace: Of the camera.
    """

    def __init__(self, info: StreamInfo, pace: Pace) -> None:
        self._keeps_pace = info.live and not info.waits_for_reader
        self._pace = pace
        self._waiting_parity = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(info.field_order)
        self._before_ns: int | None = None
        self._dequeued_ns: int | None = None
        self.way = Way()
        self._stamped: tuple[int, int, int] | None = None
        self._variations = 0

    @property
    def tells_of_stamps(self) -> bool:
        """True once stamps are known to be independent of the arrivals: they vary against them."""
        return self._variations >= _VARIATIONS

    def compare(self, arrival: Arrival, stamp_ns: int) -> bool:
        """Compare an arrival with its field's stamp, if that is trusted.

        Returns:
            True if the stamp may be the time of the arrival, as those before it may.
        """
        if arrival.time_ns is None:
            return False
        varied = False
        if self._stamped is not None:
            newest_ns, before_ns, way_ns = self._stamped
            varied = abs(arrival.time_ns - stamp_ns - way_ns) > _BURST * self._pace.period_ns
            # Stamps that stand still or run backward also vary, but are no evidence; nor is the next one.
            ahead = min(stamp_ns, before_ns) >= newest_ns - _BURST * self._pace.period_ns
            self._variations += varied and ahead and stamp_ns - before_ns > _BURST * self._pace.period_ns
            newest_ns = max(newest_ns, stamp_ns)
        else:
            newest_ns = stamp_ns
        self._stamped = newest_ns, stamp_ns, arrival.time_ns - stamp_ns
        return not (varied or self.tells_of_stamps)

    def look(self, parity: int, now_ns: int | None) -> Arrival:
        """Add the next field's arrival."""
        if now_ns is None or not self._keeps_pace:
            return Arrival(None, burst=False, joined=False)
        # The older field of a frame waits for the newer one.
        arrival_ns = now_ns - (round(self._pace.period_ns) if parity == self._waiting_parity else 0)
        before_ns, self._before_ns = self._before_ns, arrival_ns
        burst = before_ns is not None and arrival_ns - before_ns < _BURST * self._pace.period_ns
        woven = self._waiting_parity is not None and parity != self._waiting_parity
        joined = woven and now_ns == self._dequeued_ns
        self._dequeued_ns = now_ns
        return Arrival(arrival_ns, burst, joined)

    def exposed_ns(self, arrival: Arrival) -> int | None:
        """Exposure of a field that came by the shortest way; None while that is unknown."""
        if arrival.time_ns is None or math.isinf(self.way.periods):
            return None
        return arrival.time_ns - round(self.way.periods * self._pace.period_ns)

    def learn_anew(self, ways_ns: Sequence[int]) -> None:
        """Learn the way from these fields only, since a longer exposure has a longer one."""
        self.way = Way()
        for way_ns in [min(ways_ns), *ways_ns] if ways_ns else ():
            self.way = self.way.after(way_ns / self._pace.period_ns)

    def learn(self, arrival: Arrival, time_ns: int) -> None:
        """Learn the way from a field whose time is known."""
        if arrival.time_ns is not None:
            periods = (arrival.time_ns - time_ns) / self._pace.period_ns
            self.way = self.way.after(periods, joined=arrival.joined)
