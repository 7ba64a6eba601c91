"""Timestamps of the driver: which of them are trusted, and on what clock they are."""

import math
from statistics import median

from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.pace import Pace

_BACKWARD = 1.5
"""Periods by which a stamp may be before the last one: one of them was late."""
FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_OLDEST_NS = 10_000_000_000
"""Age of a stream's first stamp beyond which it is from another clock."""
_LONGEST_GAP_S = 10.0
"""Longest gap for which a stamp is trusted without an arrival that confirms it."""


_WAYS = 64
"""Fields in time whose shortest way from stamp to arrival is compared with that of others."""
MOVED = 0.25
"""Periods by which that way has changed for good. So much is corrected at once: less than what would pass for
a lost field."""
_CALM = 0.3
"""Periods by which half of those fields take longer at most: else the computer may be busy."""
_AGREE = 0.5
"""Periods within which stamps that are off must be off alike before another clock is accepted: closer to the
steps counted than to any other number of them."""
OF_DOUBTED, OF_GOOD = 3, 8
"""Number of such consecutive stamps: of untrusted ones, and of those whose fields arrived in time. More of
the latter are needed, since stamps that are merely late may agree by chance."""


class Stamps:
    """Timestamps as the driver gives them, on the clock that the first of them was on.

    Stamps that are zero, run backward or are in the future are not trusted. If they stay off but agree with
    one another, they are from another clock: from then on they are shifted to continue the old one. A clock
    of another rate, or one that is set by less than a period, changes the way from stamp to arrival for good:
    then they are shifted so that it stays.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
        pace: Of the camera.
    """

    def __init__(self, info: StreamInfo, pace: Pace) -> None:
        self._live = info.live
        self._keeps_pace = info.live and not info.waits_for_reader
        self._pace = pace
        self._max_steps = _LONGEST_GAP_S * info.rate_hz if info.live else float("inf")
        self._backward = _BACKWARD if info.live else 0.0
        self._offset_ns = 0
        self._last_ns: int | None = None
        self._off_ns: list[int] = []
        self._ways: list[float] = []
        self._moved = 0.0
        self._way: float | None = None

    def look(self, stamp_ns: int, now_ns: int | None, *, interrupted: bool) -> tuple[int, str | None]:
        """Time of a stamp on this clock, and the reason not to trust it or None."""
        time_ns = stamp_ns - self._offset_ns
        doubt = self._doubt(stamp_ns, time_ns, now_ns, interrupted)
        if doubt is None:
            # The newest, not the last: stamps that run slowly backward would all be trusted.
            self._last_ns = time_ns if self._last_ns is None else max(time_ns, self._last_ns)
        return time_ns, doubt

    def _doubt(self, stamp_ns: int, time_ns: int, now_ns: int | None, interrupted: bool) -> str | None:
        if self._live and stamp_ns <= 0:
            return "zero timestamp"
        if self._keeps_pace and now_ns is not None and time_ns > now_ns + FUTURE_NS:
            return "far-off timestamp"
        if self._last_ns is None:
            too_old = self._keeps_pace and now_ns is not None and time_ns < now_ns - _OLDEST_NS
            return "far-off timestamp" if too_old else None
        steps = (time_ns - self._last_ns) / self._pace.period_ns
        if steps < -self._backward:
            return "backward timestamp"
        confirmed = interrupted or (self._keeps_pace and now_ns is not None)
        return "far-off timestamp" if steps > self._max_steps and not confirmed else None

    def fits(self) -> None:
        """Note that a field's stamp was on time."""
        self._off_ns.clear()

    def arrived(self, way_ns: int) -> float:
        """Note the way from a stamp to the arrival of its field, which came in time.

        Returns:
            Periods by which that way has become longer for good.
        """
        self._ways.append(way_ns / self._pace.period_ns)
        if len(self._ways) < _WAYS:
            return 0.0
        least, typical, self._ways = min(self._ways), median(self._ways), []
        if typical - least > _CALM:
            return 0.0
        self._way = least if self._way is None else self._way
        before, self._moved = self._moved, least - self._way
        return min(before, self._moved, key=abs) if before * self._moved > 0 else 0.0

    def keep_way(self, longer: float) -> None:
        """Correct the clock, where the way to the arrivals has become longer by so many periods."""
        by = math.copysign(min(abs(longer), MOVED), longer)
        self._offset_ns -= round(by * self._pace.period_ns)
        self._moved -= by

    def arrive_anew(self) -> None:
        """Note that fields take another way from now on, as with another exposure."""
        self._ways, self._moved, self._way = [], 0.0, None

    def watch(self, stamp_ns: int, predicted_ns: int, sightings: int) -> int:
        """Note a stamp that is off; so many in a row that agree are those of another clock.

        Returns:
            The time by which that one is ahead of the clock before; 0 while it is the same.
        """
        off_ns = stamp_ns - predicted_ns
        self._off_ns = [one for one in self._off_ns if abs(off_ns - one) <= _AGREE * self._pace.period_ns]
        self._off_ns.append(off_ns)
        if len(self._off_ns) < sightings:
            return 0
        before_ns, self._offset_ns = self._offset_ns, sum(self._off_ns) // len(self._off_ns)
        self._last_ns = predicted_ns
        self._off_ns.clear()
        set_by_ns = self._offset_ns - before_ns
        return set_by_ns if abs(set_by_ns) > _AGREE * self._pace.period_ns else 0

    def explains(self, stamp_ns: int, predicted_ns: int) -> bool:
        """True if a stamp is from the clock that is now followed, but was not when the stamp came."""
        return (
            stamp_ns > 0 and abs(stamp_ns - self._offset_ns - predicted_ns) <= _AGREE * self._pace.period_ns
        )
