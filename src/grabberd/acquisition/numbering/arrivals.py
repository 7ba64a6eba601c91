"""Arrivals of a stream's fields: when each came, with which others, and how long its way was."""

from typing import NamedTuple

from grabberd.acquisition.device import FieldOrder, StreamInfo

_BURST = 0.3
"""Periods between arrivals, below which fields have waited in the driver's buffers."""
_VARIATIONS = 4
"""Changes of the time from stamp to arrival, after which it is no constant: a clock that is set makes one."""
_WAY_GROWS_NS = 20_000
"""Growth of the shortest way from field to field, so that it follows a computer that becomes slower."""


class Arrival(NamedTuple):
    """Arrival of one field.

    Attributes:
        time_ns: When it could have been here at the earliest; None if that tells nothing.
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
    """

    def __init__(self, info: StreamInfo) -> None:
        self._keeps_pace = info.live and not info.waits_for_reader
        self._period_ns = 1e9 / info.rate_hz
        self._waiting_parity = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(info.field_order)
        self._before_ns: int | None = None
        self._dequeued_ns: int | None = None
        self.way_ns: int | None = None
        self._stamped: tuple[int, int] | None = None
        self._variations = 0

    @property
    def tells_of_stamps(self) -> bool:
        """True once stamps are known to come from somewhere else than the arrival: they vary against it."""
        return self._variations >= _VARIATIONS

    def compare(self, arrival: Arrival, stamp_ns: int) -> None:
        """Compare an arrival with its field's stamp, if that is believed."""
        if arrival.time_ns is None:
            return
        if self._stamped is not None:
            before_ns, way_ns = self._stamped
            # Stamps that stand still or run backward vary as well, and tell nothing.
            runs_on = stamp_ns - before_ns > _BURST * self._period_ns
            varied = abs(arrival.time_ns - stamp_ns - way_ns) > _BURST * self._period_ns
            self._variations += runs_on and varied
        self._stamped = stamp_ns, arrival.time_ns - stamp_ns

    def look(self, parity: int, now_ns: int | None) -> Arrival:
        """Take in the next field's arrival."""
        if now_ns is None or not self._keeps_pace:
            return Arrival(None, burst=False, joined=False)
        # The older field of a frame waits for the newer one.
        arrival_ns = now_ns - (round(self._period_ns) if parity == self._waiting_parity else 0)
        before_ns, self._before_ns = self._before_ns, arrival_ns
        burst = before_ns is not None and arrival_ns - before_ns < _BURST * self._period_ns
        woven = self._waiting_parity is not None and parity != self._waiting_parity
        joined = woven and now_ns == self._dequeued_ns
        self._dequeued_ns = now_ns
        return Arrival(arrival_ns, burst, joined)

    def exposed_ns(self, arrival: Arrival) -> int | None:
        """Exposure of a field that came by the shortest way; None while that is unknown."""
        if arrival.time_ns is None or self.way_ns is None:
            return None
        return arrival.time_ns - self.way_ns

    def forget(self) -> None:
        """Learn the way anew: the times were wrong that it was learned from."""
        self.way_ns = None

    def learn(self, arrival: Arrival, time_ns: int) -> None:
        """Learn the way from a field whose time is known."""
        if arrival.time_ns is None:
            return
        way_ns = arrival.time_ns - time_ns
        self.way_ns = way_ns if self.way_ns is None else min(way_ns, self.way_ns + _WAY_GROWS_NS)
