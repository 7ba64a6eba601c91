"""Dating of a logger's readings, by its own clock or by arrival, and the count of those that never came.

    arrival = own time + offset + drift + way,    way = shortest way + what held the reading up

Offset, drift and shortest way are found together, from the readings that came soonest: a delay can be too
long by any amount and never too short, so the line sought lies under all of them. The shortest way cannot be
told from the offset, and makes all readings late alike. Neither can a way that everything takes for minutes
be told from a clock that was set: both begin a new relation.
"""

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.channels.logger import Anomaly
from grabberd.errors import StreamFailed

USUAL_DRIFT = 1e-4
"""Drift that crystals reach. Ceramic resonators drift fifty times as much: unlikely, not impossible."""
_LEAST_DELAYS = 5
"""Delays from which on a drift can be told: any line touches two, and the better half must have one more."""
FLOOR_NS = 20_000.0
"""Regularity of the best of clocks and kernels: no excess, and no σ, is less."""


class Line(NamedTuple):
    """A line under delays.

    Attributes:
        offset: Its value at 0, in ns.
        slope: Its slope, without a unit.
        excess: Mean excess of the better half of the delays over it, in ns.
    """

    offset: float
    slope: float
    excess: float

    def at(self, x: float) -> float:
        """Value of the line."""
        return self.offset + self.slope * x


def lower_envelope(x: Array, y: Array) -> Line:
    """The line under all delays that the better half of them is closest to.

    Only the edges of the lower convex hull touch two delays and lie above none, and the level through the
    shortest delay is what a clock without drift has. The likelihood is that of delays that exceed their
    shortest exponentially; their worse half does not count, so that a minute of load does not tilt the line.

    Args:
        x: (N,) times in ns, ascending.
        y: (N,) delays in ns.
    """
    slopes = np.array([0.0, *(_hull_slopes(x, y) if len(x) >= _LEAST_DELAYS else ())])
    above = y[None, :] - slopes[:, None] * x[None, :]
    offsets = above.min(axis=1)
    better = (len(x) + 1) // 2
    nearest = np.partition(above - offsets[:, None], better - 1, axis=1)[:, :better]
    excess = nearest.mean(axis=1)
    unlikelihood = len(x) * np.log(excess + FLOOR_NS) + np.log1p((slopes / USUAL_DRIFT) ** 2)
    best = int(np.argmin(unlikelihood))
    return Line(float(offsets[best]), float(slopes[best]), float(excess[best]))


def _hull_slopes(x: Array, y: Array) -> list[float]:
    """Slopes of the edges of the lower convex hull."""
    corners: list[tuple[float, float]] = []
    for point in zip(x.tolist(), y.tolist(), strict=True):
        while len(corners) > 1 and _slope(corners[-2], corners[-1]) >= _slope(corners[-2], point):
            corners.pop()
        corners.append(point)
    return [_slope(*edge) for edge in pairwise(corners)]


def _slope(first: tuple[float, float], second: tuple[float, float]) -> float:
    return (second[1] - first[1]) / (second[0] - first[0])


Times = NDArray[np.int64]

CLOCK_JUMPED = "the logger's clock jumped"

SPAN_NS = 500_000_000
"""Time of whose readings the soonest is kept."""
_KEPT = 240
"""Number of such spans: two minutes, in which the temperature of a crystal hardly changes."""
_FORGOTTEN_NS = _KEPT * SPAN_NS
"""Silence after which the relation begins anew."""
_KNOWN = 8
"""Spans from which on a clock is known well enough to notice that it jumps."""
_LEAST_JUMP_NS, _UNLIKELY = 5e6, 12.0
"""Least jump that is noticed, and how many times it must exceed what readings are usually late by."""
_SUSTAINED = 6
"""Spans for which all readings must be late before the clock is said to have been set back."""
_SLOPE_LIMIT = 0.05
"""Drift that no clock has: the unit of its time is another one."""
_UNSEEN_NS = 10e6
"""Lateness that the first readings must be suspected of."""
_YOUNG_NS = 50e6
"""The same for a relation's very first reading, which nothing compares with."""


class Dated(NamedTuple):
    """Times of readings.

    Attributes:
        time_ns: (K,) CLOCK_MONOTONIC, ascending, also from one call to the next.
        sigma_ns: Their standard deviation, without the shortest way.
        anomalies: What their times have shown.
    """

    time_ns: Times
    sigma_ns: int
    anomalies: tuple[Anomaly, ...] = ()


@dataclass(slots=True)
class _Span:
    """Readings that arrived within a span of time: the soonest, and how late all were together."""

    number: int
    x: float
    y: float
    total: float
    count: int

    def add(self, x: float, y: float, slope: float) -> None:
        self.total += y
        self.count += 1
        if y - slope * x < self.y - slope * self.x:
            self.x, self.y = x, y


class ClockRelation:
    """The relation of one logger's clock, which improves with every reading.

    Args:
        resolution_ns: Step of the logger's clock; 0 if it is as fine as the numbers.
    """

    def __init__(self, resolution_ns: float = 0.0) -> None:
        self._resolution_sigma_ns = resolution_ns / math.sqrt(12)
        self._spans: deque[_Span] = deque(maxlen=_KEPT)
        self._line = Line(0.0, 0.0, 0.0)
        self._start_own_ns = self._start_ns = self._arrived_ns = self._sigma_ns = 0
        self._newest_own_ns: int | None = None
        self._newest_ns = -(2**62)

    @property
    def drift(self) -> float:
        """Share by which the logger's clock runs slow."""
        return self._line.slope

    def date(self, own_ns: Times, arrival_ns: int) -> Dated:
        """Date readings that arrived together.

        Args:
            own_ns: (K,) the logger's own times, K ≥ 1.
            arrival_ns: When they arrived, CLOCK_MONOTONIC.

        Raises:
            StreamFailed: The logger's clock runs so fast or slow that its unit must be another one.
        """
        steps_back = np.flatnonzero(np.diff(own_ns) <= 0) + 1
        jumps_ns: list[int] = []
        times = [self._date(part, arrival_ns, jumps_ns) for part in np.split(own_ns, steps_back)]
        jumps = tuple(Anomaly(arrival_ns, CLOCK_JUMPED, f"{jump_ns / 1e9:+.4f} s") for jump_ns in jumps_ns)
        return Dated(self._ascending(np.concatenate(times)), self._sigma_ns, jumps)

    def _date(self, own_ns: Times, arrival_ns: int, jumps_ns: list[int]) -> Times:
        newest_ns = int(own_ns[-1])
        if not self._spans or arrival_ns - self._arrived_ns > _FORGOTTEN_NS:
            self._begin(newest_ns, arrival_ns)
        else:
            jump_ns = self._jump_ns(int(own_ns[0]), newest_ns, arrival_ns)
            if jump_ns:
                jumps_ns.append(jump_ns)
                self._begin(newest_ns, arrival_ns)
        set_back_ns = self._learn(newest_ns, arrival_ns)
        if set_back_ns:
            jumps_ns.append(-set_back_ns)
        self._newest_own_ns, self._arrived_ns = newest_ns, arrival_ns
        since_ns = own_ns - self._start_own_ns
        delay_ns = np.floor(self._line.offset + self._line.slope * since_ns).astype(np.int64)
        return self._start_ns + since_ns + delay_ns

    def _begin(self, own_ns: int, arrival_ns: int) -> None:
        self._spans.clear()
        self._start_own_ns, self._start_ns = own_ns, arrival_ns
        # The same quartz as before a jump: its drift stays until the new readings know better.
        self._line = Line(0.0, self._line.slope, 0.0)

    def _point(self, own_ns: int, arrival_ns: int) -> tuple[float, float]:
        x = own_ns - self._start_own_ns
        return float(x), float(arrival_ns - self._start_ns - x)

    def _jump_ns(self, first_own_ns: int, own_ns: int, arrival_ns: int) -> int:
        """Distance of a jump that one reading shows: time ran backward, or it came before it was taken."""
        since_ns = arrival_ns - self._start_ns
        latest = (since_ns - self._line.offset) / (1 + self._line.slope)
        ahead_ns = round(own_ns - self._start_own_ns - latest)
        if self._newest_own_ns is not None and first_own_ns <= self._newest_own_ns:
            return min(ahead_ns, first_own_ns - self._newest_own_ns - 1)
        return ahead_ns if len(self._spans) >= _KNOWN and ahead_ns > self._threshold_ns() else 0

    def _threshold_ns(self) -> float:
        return max(_LEAST_JUMP_NS, _UNLIKELY * self._line.excess)

    def _learn(self, own_ns: int, arrival_ns: int) -> int:
        """Take in the newest reading of a batch; the distance by which the clock has been set back, or 0."""
        x, y = self._point(own_ns, arrival_ns)
        number = arrival_ns // SPAN_NS
        set_back_ns = 0
        if self._spans and self._spans[-1].number == number:
            self._spans[-1].add(x, y, self._line.slope)
            if y >= self._line.at(x):
                return 0
        else:
            set_back_ns = self._set_back_ns()
            self._spans.append(_Span(number, x, y, y, 1))
        self._fit()
        self._sigma_ns = self._sigma()
        return set_back_ns

    def _set_back_ns(self) -> int:
        """Distance by which all readings have been late for a while; those before them are dropped then."""
        if len(self._spans) < _KNOWN + _SUSTAINED:
            return 0
        newest = list(self._spans)[-_SUSTAINED:]
        late = np.array([span.y - self._line.at(span.x) for span in newest])
        threshold = self._threshold_ns()
        if late.min() < threshold or np.ptp(late) > threshold / 2:
            return 0
        self._spans.clear()
        self._spans.extend(newest)
        return round(float(late.min()))

    def _fit(self) -> None:
        x = np.array([span.x for span in self._spans])
        y = np.array([span.y for span in self._spans])
        if len(x) == 1:
            self._line = Line(float(y[0]) - self._line.slope * float(x[0]), self._line.slope, 0.0)
            return
        self._line = lower_envelope(x, y)
        if len(x) >= _KNOWN and abs(self._line.slope) > _SLOPE_LIMIT:
            pace = 1 / (1 + self._line.slope) if self._line.slope > -1 else math.inf
            raise StreamFailed(
                f"the logger's clock runs {pace:.3g} times as fast as the computer's",
                "state the right unit of its time (s, ms, us, ns), or its true rate_hz",
            )

    def _ascending(self, time_ns: Times) -> Times:
        """The times, none earlier than the one before it was said to be."""
        # Whatever is learnt moves the relation a little, and may move it backward.
        least = self._newest_ns + 1 + np.arange(len(time_ns))
        rising = np.maximum.accumulate(np.maximum(time_ns - least, 0)) + least
        self._newest_ns = int(rising[-1])
        return rising

    def _sigma(self) -> int:
        """Standard deviation of the line where it is now: by how much the soonest reading may be late."""
        spans = len(self._spans)
        batches = sum(span.count for span in self._spans)
        late = (span.total - span.count * self._line.at(span.x) for span in self._spans)
        lateness = sum(late) / batches
        # Readings of one span share what the computer was doing then: they are no independent trials.
        trials = math.sqrt(batches * spans)
        soonest = (_YOUNG_NS if batches == 1 else _UNSEEN_NS + max(lateness, 0.0)) / trials
        # Of delays that exceed their shortest exponentially, the shortest of N does by the N-th part; two of
        # them are what the line was laid through, and at its end it is four times as uncertain.
        excess = sum(span.y - self._line.at(span.x) for span in self._spans)
        line = 4 * excess / spans / max(spans - 2, 1)
        return round(math.hypot(self._resolution_sigma_ns, soonest, line, FLOOR_NS))


_FIRST_NS = 50_000_000
"""Time in which the readings that come first were taken: nothing is known of them."""


class ArrivalDating:
    """Dates readings by their arrival alone.

    Readings that come together, as a USB adapter delivers them, are spread over the time since those before.
    """

    def __init__(self) -> None:
        self._before_ns: int | None = None

    def date(self, count: int, arrival_ns: int) -> Dated:
        """Date so many readings that arrived together, `count` ≥ 1."""
        before_ns = arrival_ns - _FIRST_NS if self._before_ns is None else self._before_ns
        arrival_ns = max(arrival_ns, before_ns + count)
        span_ns = arrival_ns - before_ns
        self._before_ns = arrival_ns
        time_ns: NDArray[np.int64] = before_ns + span_ns * np.arange(1, count + 1, dtype=np.int64) // count
        return Dated(time_ns, round(span_ns / math.sqrt(12)))


MISSING = "readings are missing"
_USUAL_STEPS, _LEAST_STEPS = 64, 8
"""Steps that tell the usual one, and the least number of them."""
_GAP = 1.6
"""Usual steps from which on a reading is missing; a logger's own timer jitters by less."""


class MissingReadings:
    """Counts missing readings of a logger that reads at a steady rate, which is learnt."""

    def __init__(self) -> None:
        self._steps_ns: deque[int] = deque(maxlen=_USUAL_STEPS)
        self._before_ns: int | None = None

    @property
    def rate_hz(self) -> float | None:
        """Readings per second of the logger's own time; None until a few have come."""
        usual_ns = self._usual_ns()
        return 1e9 / usual_ns if usual_ns else None

    def look(self, own_ns: NDArray[np.int64], arrival_ns: int) -> tuple[Anomaly, ...]:
        """Take in readings that arrived together; their gap, if any readings are missing among them."""
        missing = sum(self._missing(int(time_ns)) for time_ns in own_ns)
        if not missing:
            return ()
        return (Anomaly(arrival_ns, MISSING, f"{missing} before {own_ns[-1] / 1e9:.3f} s", missing),)

    def begin_anew(self) -> None:
        """Note that the logger's clock was set: the next step tells nothing."""
        self._before_ns = None

    def _missing(self, time_ns: int) -> int:
        before_ns, self._before_ns = self._before_ns, time_ns
        step_ns = 0 if before_ns is None else time_ns - before_ns
        if step_ns <= 0:
            return 0
        usual_ns = self._usual_ns()
        self._steps_ns.append(step_ns)
        return round(step_ns / usual_ns) - 1 if usual_ns and step_ns > _GAP * usual_ns else 0

    def _usual_ns(self) -> float | None:
        return float(median(self._steps_ns)) if len(self._steps_ns) >= _LEAST_STEPS else None
