"""Timestamps of a stream: which are not believed, and how many periods late each is."""

from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.numbering.pace import Pace

_BACKWARD = 1.5
"""Periods by which a stamp may lie before the last one: one of them was late."""
FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_OLDEST_NS = 10_000_000_000
"""Age of a stream's first stamp, beyond which it is of another clock."""
_LONGEST_GAP_S = 10.0
"""Longest gap that a stamp is believed where no arrival confirms it."""


_AGREE = 0.5
"""Periods within which stamps that are off must be off alike before another clock is accepted: closer to the
steps counted than to any other number of them."""
_OF_DOUBTED, _OF_GOOD = 3, 8
"""Number of such stamps in a row. Good ones need more: what is merely late may be so alike by chance."""


class Stamps:
    """Timestamps as the driver gives them, on the clock that the first of them was on.

    Stamps that are zero, run backward or come out of the future are not believed. If they stay off but agree
    among themselves, another clock has taken over: from then on they are shifted to continue the old one.

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

    def look(self, stamp_ns: int, now_ns: int | None, *, interrupted: bool) -> tuple[int, str | None]:
        """Time that a stamp means, and the reason not to believe it or None."""
        time_ns = stamp_ns - self._offset_ns
        doubt = self._doubt(stamp_ns, time_ns, now_ns, interrupted)
        if doubt is None:
            # The newest, not the last: stamps that run backward by a little each would all be believed.
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

    def doubted(self, stamp_ns: int, predicted_ns: int) -> int:
        """Note a stamp that is not believed; some that agree are those of another clock.

        Returns:
            The time by which that one is ahead of the clock before; 0 while it is the same.
        """
        return self._watch(stamp_ns, predicted_ns, _OF_DOUBTED)

    def off(self, stamp_ns: int, predicted_ns: int) -> int:
        """Note a stamp that is off although its field arrived in time; more of them are needed.

        Returns:
            As `doubted`.
        """
        return self._watch(stamp_ns, predicted_ns, _OF_GOOD)

    def explains(self, stamp_ns: int, predicted_ns: int) -> bool:
        """True if a stamp is one of the clock that is followed by now, which it was not when it came."""
        return abs(stamp_ns - self._offset_ns - predicted_ns) <= _AGREE * self._pace.period_ns

    def _watch(self, stamp_ns: int, predicted_ns: int, sightings: int) -> int:
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
