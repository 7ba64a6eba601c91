"""Pace of a camera: the actual time from one picture to the next, which may differ from the granted one."""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.device import StreamInfo

_FEWEST, _MOST = 8, 64
"""Consecutive intervals that establish a pace: few if it is far from the expected one, more if close."""
_ALIKE = 0.2
"""Share of their mean by which intervals of a steady pace may differ."""
_DRIFT, _OF_MANY, _MANY = 0.35, 0.2, 32
"""Periods that the pictures of a steady pace may gain or lose in total before it is another pace; from that
number on. With half a period they would be numbered wrongly."""
_SURELY = 5.0
"""Standard deviations by which the period of another pace differs: stamps that jitter by half a period, as on
USB, gain and lose a third of one within a few fields."""
_BENDS, _OF_BENDS = 0.9, 1.645 * math.sqrt(6)
"""Share of the changes of intervals that is jitter, while a few come of losses; and ratio of the largest of
them to the σ of a time."""
_BATCHES_NS = 2_300_000
"""Least σ of a time: USB delivers in batches of 8 ms."""
_SHORTEST, _LONGEST = 0.9, 12.0
"""Range of a pace in granted periods: a camera slows down in the dark, but hardly becomes faster."""
_LONG = 1.6
"""Ratio of an interval to its neighbours from which on a picture may be lost uncounted."""
_AS_COUNTED = 0.1
"""Relative deviation of an interval from the pace times its count."""
SUSPECTED = 20
"""Fields held after such an interval, during which another pace may explain it."""
_NOTABLE = 0.05
"""Relative deviation from the last reported rate from which on a rate is reported again."""


class Came(NamedTuple):
    """A field as received.

    Attributes:
        time_ns: Its time by its stamp; None if that is not trusted.
        counted: Fields since the previous one by the driver's count; None if unknown.
        way_ns: From its time to its arrival; None if unknown.
        has_waited: True if it may have waited, or the stream was interrupted before it.
    """

    time_ns: int | None
    counted: int | None
    way_ns: int | None
    has_waited: bool


class Pace:
    """Expected time from field to field of the camera.

    A digital camera with automatic exposure delivers fewer pictures in the dark than granted. If it counts
    its pictures and sends them steadily, its actual pace replaces the granted one. A draining queue looks
    steady as well, so no field of a pace may have waited. Without a count, every second picture may just as
    well be lost: then the pace is reported, but not followed.

    Args:
        info: The stream as granted.

    Attributes:
        period_ns: Time from field to field, granted or followed; `rate_hz`: fields per second.
        steady_hz: Rate of the latest fields that came steadily; None while none did.
        is_followed: True if a steady pace other than that granted would be followed.
    """

    def __init__(self, info: StreamInfo) -> None:
        self.rate_hz = self._granted_hz = self._reported_hz = info.rate_hz
        self.period_ns = self._granted_ns = 1e9 / info.rate_hz
        self.steady_hz: float | None = None
        keeps_pace = info.live and not info.waits_for_reader
        self._is_free = keeps_pace and info.field_order is FieldOrder.PROGRESSIVE
        self.is_followed = self._is_free and info.counts_losses
        self._steady: deque[Came] = deque(maxlen=_MOST + 1)
        self._recent: deque[Came] = deque(maxlen=_MOST)
        self._suspected = 0

    @property
    def may_change(self) -> bool:
        """True while a long interval is unexplained: pictures were lost, or the camera delivers fewer."""
        return self._suspected > 0

    @property
    def before_ns(self) -> int:
        """Time of the field before the last, by its stamp."""
        return self._recent[-2].time_ns or 0

    @property
    def ways_ns(self) -> Sequence[int]:
        """Ways of the latest fields, as many as establish a pace."""
        latest = list(self._recent)[-_FEWEST - 1 :]
        return [one.way_ns for one in latest if one.way_ns is not None]

    def see(self, came: Came) -> bool:
        """Add the next field; True if the camera now has another pace, which is followed."""
        if not self._is_free:
            return False
        self._suspect(came)
        self._recent.append(came)
        self._add(came)
        times_ns = [one.time_ns for one in self._steady if one.time_ns is not None]
        intervals = len(times_ns) - 1
        if intervals < _FEWEST:
            return False
        self._suspected = 0
        mean_ns, left_ns = _fitted(times_ns)
        self.steady_hz = 1e9 / mean_ns
        off_ns = abs(mean_ns - self.period_ns)
        drift = off_ns / self.period_ns * intervals
        if not self.is_followed or drift < (_DRIFT if intervals < _MANY else _OF_MANY):
            return False
        of_places = len(times_ns) * (len(times_ns) ** 2 - 1) / 12
        if off_ns < _SURELY * max(left_ns, self._jitter_ns) / math.sqrt(of_places):
            return False
        if not _SHORTEST < mean_ns / self._granted_ns < _LONGEST:
            return False
        self.period_ns, self.rate_hz = mean_ns, self.steady_hz
        self._steady.clear()
        return True

    @property
    def _jitter_ns(self) -> float:
        """σ of the latest times, whatever the pace: by chance or on a grid, a few of them lie on a line."""
        times_ns = [one.time_ns for one in self._recent if one.time_ns is not None and one.counted == 1]
        if len(times_ns) < _FEWEST:
            return _BATCHES_NS
        bends = np.diff(np.array([time_ns - times_ns[0] for time_ns in times_ns], float), 2)
        return max(float(np.quantile(np.abs(bends), _BENDS)) / _OF_BENDS, _BATCHES_NS)

    def unexplained(self, back: int) -> int:
        """Pictures that may be lost uncounted before the field that came so many before the newest.

        Between two paces only the interval itself shows a loss: it is longer than those on both sides.
        """
        around = list(self._recent)[-back - 3 :][:4]
        if back < 1 or len(around) < 4:
            return 0
        before_ns, own_ns, after_ns = (_interval_ns(*two) for two in pairwise(around))
        beside_ns = max(before_ns, after_ns)
        if not self._is_long(own_ns, beside_ns):
            return 0
        return (around[2].counted or 1) * (round(own_ns / beside_ns) - 1)

    def _is_long(self, interval_ns: float, beside_ns: float) -> bool:
        """True for one that is long for the granted pace too: jitter makes others long beside a short one."""
        return beside_ns > 0 and interval_ns > _LONG * max(beside_ns, self._granted_ns)

    def take_changed(self) -> str | None:
        """Sentence about a rate not yet reported; None if there is nothing new."""
        if abs(self.rate_hz / self._reported_hz - 1) < _NOTABLE:
            return None
        self._reported_hz = self.rate_hz
        return (
            f"the camera delivers {self.rate_hz:.1f} pictures a second, {self._granted_hz:.4g} were granted"
        )

    def _suspect(self, came: Came) -> None:
        """Note an interval that is much longer than the previous one, or does not match its count."""
        self._suspected = max(self._suspected - 1, 0)
        if not self.is_followed or len(self._recent) < 2:
            return
        before, last = self._recent[-2], self._recent[-1]
        interval_ns, before_ns = _interval_ns(last, came), _interval_ns(before, last)
        miscounted = came.counted not in {None, 1} and abs(interval_ns / self.period_ns - 1) > _AS_COUNTED
        if interval_ns and (miscounted or self._is_long(interval_ns, before_ns)):
            self._suspected = SUSPECTED

    def _add(self, came: Came) -> None:
        """Append a field that follows the previous one steadily, or start again with it."""
        steady = self._steady
        if came.time_ns is None or came.has_waited:
            steady.clear()
            return
        if self.is_followed and came.counted != 1:
            steady.clear()
        elif steady and not self._is_alike(_interval_ns(steady[-1], came)):
            before = steady[-1]
            steady.clear()
            steady.append(before)  # the interval between them may be the first of another pace
        steady.append(came)

    def _is_alike(self, interval_ns: float) -> bool:
        if len(self._steady) < 2:
            return interval_ns > 0
        first_ns, last_ns = self._steady[0].time_ns, self._steady[-1].time_ns
        if first_ns is None or last_ns is None:
            return False
        mean_ns = (last_ns - first_ns) / (len(self._steady) - 1)
        return abs(interval_ns - mean_ns) <= _ALIKE * mean_ns


def _fitted(times_ns: Sequence[int]) -> tuple[float, float]:
    """Time from field to field that fits best, and the σ of what is left of the times."""
    places = np.arange(len(times_ns)) - (len(times_ns) - 1) / 2
    times = np.array([time_ns - times_ns[0] for time_ns in times_ns], float)
    times -= times.mean()
    slope_ns = float(places @ times) / float(places @ places)
    left = times - slope_ns * places
    return slope_ns, math.sqrt(float(left @ left) / (len(times_ns) - 2))


def _interval_ns(one: Came, other: Came) -> float:
    """Time from field to field between two of which one came after the other; 0 if that is unknown."""
    if one.time_ns is None or other.time_ns is None:
        return 0.0
    return (other.time_ns - one.time_ns) / (other.counted or 1)
