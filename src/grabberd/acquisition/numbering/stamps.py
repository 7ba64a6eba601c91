"""Timestamps of a stream: which are not believed, and how many periods late each is."""

from typing import NamedTuple

from grabberd.acquisition.device import StreamInfo

_BACKWARD = 1.5
"""Periods by which a stamp may lie before the last one: one of them was late."""
_FUTURE_NS = 100_000_000
"""Grace time: how far a stamp may be ahead of the arrival of its field before it is doubted."""
_LONGEST_GAP_S = 10.0
"""Longest gap that a stamp is believed where no arrival confirms it."""


class _Agreement(NamedTuple):
    """Stamps in a row that must agree among themselves, and how well, before another clock is accepted."""

    sightings: int
    periods: float


# Half a period: closer to the steps counted than to any other number of them. Stamps that are merely late are
# as late as the one before by chance.
_OF_DOUBTED, _OF_GOOD_STAMPS = _Agreement(3, 0.5), _Agreement(5, 0.1)


class Stamps:
    """Timestamps as the driver gives them, on the clock that the first of them was on.

    Stamps that are zero, run backward or come out of the future are not believed. If they stay off but agree
    among themselves, another clock has taken over: from then on they are shifted to continue the old one.

    Args:
        info: The stream as granted. The times of a recording are taken as they are.
    """

    def __init__(self, info: StreamInfo) -> None:
        self._live = info.live
        self._keeps_pace = info.live and not info.waits_for_reader
        self._period_ns = 1e9 / info.rate_hz
        self._max_steps = _LONGEST_GAP_S * info.rate_hz if info.live else float("inf")
        self._backward = _BACKWARD if info.live else 0.0
        self._offset_ns = 0
        self._last_ns: int | None = None
        self._off: list[tuple[int, int]] = []

    def look(self, stamp_ns: int, now_ns: int | None, *, interrupted: bool) -> tuple[int, str | None]:
        """Time that a stamp means, and the reason not to believe it or None."""
        time_ns = stamp_ns - self._offset_ns
        doubt = self._doubt(stamp_ns, time_ns, now_ns, interrupted)
        if doubt is None:
            self._last_ns = time_ns
        return time_ns, doubt

    def _doubt(self, stamp_ns: int, time_ns: int, now_ns: int | None, interrupted: bool) -> str | None:
        if self._live and stamp_ns <= 0:
            return "zero timestamp"
        if self._keeps_pace and now_ns is not None and time_ns > now_ns + _FUTURE_NS:
            return "far-off timestamp"
        if self._last_ns is None:
            return None
        steps = (time_ns - self._last_ns) / self._period_ns
        if steps < -self._backward:
            return "backward timestamp"
        confirmed = interrupted or (self._keeps_pace and now_ns is not None)
        return "far-off timestamp" if steps > self._max_steps and not confirmed else None

    def fits(self) -> None:
        """Note that a field's stamp was on time."""
        self._off.clear()

    def doubted(self, n: int, stamp_ns: int, predicted_ns: int) -> None:
        """Note a stamp that is not believed; some that agree are those of another clock."""
        self._watch(n, stamp_ns, predicted_ns, _OF_DOUBTED)

    def off(self, n: int, stamp_ns: int, predicted_ns: int) -> None:
        """Note a stamp that is off although its field arrived in time; more of them are needed."""
        self._watch(n, stamp_ns, predicted_ns, _OF_GOOD_STAMPS)

    def _watch(self, n: int, stamp_ns: int, predicted_ns: int, agreement: _Agreement) -> None:
        if self._off:
            before_n, before_ns = self._off[-1]
            if abs((stamp_ns - before_ns) / self._period_ns - (n - before_n)) > agreement.periods:
                self._off.clear()
        self._off.append((n, stamp_ns))
        if len(self._off) >= agreement.sightings:
            self._offset_ns = stamp_ns - predicted_ns
            self._last_ns = predicted_ns
            self._off.clear()
