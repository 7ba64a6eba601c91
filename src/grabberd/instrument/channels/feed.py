"""The newest readings of a logger, from its thread to its readers; means of the last minutes."""

import threading
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.reading_groups import ChannelCalibration
from grabberd.core.channels import Anomaly, Dating

STEP_NS = 20_000_000
"""Time over which readings are averaged: short compared with a pulsation, at any rate of the camera."""
STEPS = 15_000
"""Five minutes: 120 kB, and 180 kB for each channel."""


class StepMeans:
    """A ring of time steps, placed by their time, so that gaps are kept.

    Args:
        channels: Number of channels.
    """

    def __init__(self, channels: int) -> None:
        self._step = np.full(STEPS, -1, np.int64)
        self._sum = np.zeros((STEPS, channels))
        self._count = np.zeros((STEPS, channels), np.uint32)

    def add(self, time_ns: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Adds readings: (K,) and (K, channels), NaN where a channel has none."""
        steps = time_ns // STEP_NS
        places = steps % STEPS
        fresh = places[self._step[places] != steps]
        self._sum[fresh], self._count[fresh] = 0.0, 0
        self._step[places] = steps
        known = np.isfinite(values)
        np.add.at(self._sum, places, np.where(known, values, 0.0))
        np.add.at(self._count, places, known)

    def since(self, time_ns: int, channel: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(K,) middle of each step since a time in which the channel has readings, and (K,) its mean."""
        found = np.flatnonzero((self._step >= time_ns // STEP_NS) & (self._count[:, channel] > 0))
        found = found[np.argsort(self._step[found])]
        means = self._sum[found, channel] / self._count[found, channel]
        return self._step[found] * STEP_NS + STEP_NS // 2, means


KEPT_NS = 10_000_000_000
"""Age of the readings that are kept for pre-triggers and for display."""
MOST_KEPT = 200_000
"""Number of readings that are kept, and that may wait for a capture whose disk stalls."""
DISK_TOO_SLOW = "disk too slow"


class Part(NamedTuple):
    """Readings that came together.

    Attributes:
        posted_ns: When they came.
        time_ns: (K,) when each was taken, ascending.
        values: (K, C) of the logger's channels in their order, in its own units; NaN where one has none.
        kpa: (K, C) the same in kPa below atmosphere; of a light unchanged.
        calibrations: Conversions from values to kPa; the same object for all parts of one opening.
        dating: Base of the times.
        time_sigma_ns: σ of each.
        anomalies: Whatever else came.
        interruption: Why no more readings come, or None.
    """

    posted_ns: int
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    kpa: NDArray[np.float64]
    calibrations: tuple[ChannelCalibration, ...]
    dating: Dating
    time_sigma_ns: int
    anomalies: tuple[Anomaly, ...] = ()
    interruption: str | None = None

    @classmethod
    def interrupted(cls, posted_ns: int, reason: str) -> "Part":
        """A part without readings, and the reason."""
        nothing = np.empty((0, 0))
        return cls(posted_ns, np.empty(0, np.int64), nothing, nothing, (), Dating.ARRIVAL, 0, (), reason)

    @property
    def newest_ns(self) -> int:
        """Time of its last reading, or of its arrival if it has none."""
        return int(self.time_ns[-1]) if len(self.time_ns) else self.posted_ns

    def until(self, time_ns: int) -> tuple["Part", "Part | None"]:
        """The part up to a time, and the rest; anomalies are split by their own times."""
        if self.newest_ns <= time_ns:
            return self, None
        count = int(np.searchsorted(self.time_ns, time_ns, side="right"))
        earlier = tuple(one for one in self.anomalies if one.time_ns <= time_ns)
        later = tuple(one for one in self.anomalies if one.time_ns > time_ns)
        first = self._rows(slice(None, count))._replace(anomalies=earlier, interruption=None)
        return first, self._rows(slice(count, None))._replace(anomalies=later)

    def _rows(self, rows: slice) -> "Part":
        return self._replace(time_ns=self.time_ns[rows], values=self.values[rows], kpa=self.kpa[rows])


class Follower:
    """Parts that wait for one capture; those that do not fit are counted."""

    def __init__(self, feed: "Feed", kept: list[Part]) -> None:
        self._feed = feed
        self._parts = deque(kept)
        self._waiting = sum(len(one.time_ns) for one in kept)
        self._refused = 0

    def take(self, until_ns: int) -> list[Part]:
        """Removes and returns the parts up to a time, in order."""
        taken = []
        with self._feed.lock:
            while self._parts:
                first, rest = self._parts.popleft().until(until_ns)
                self._waiting -= len(first.time_ns)
                taken.append(first)
                if rest is not None:
                    self._parts.appendleft(rest)
                    break
        return taken

    def close(self) -> None:
        """Stops following."""
        with self._feed.lock:
            self._feed.followers.discard(self)

    def put(self, part: Part) -> None:
        """Adds a part; called by the feed, which holds the lock."""
        if self._waiting + len(part.time_ns) > MOST_KEPT:
            self._refused += len(part.time_ns)
            return
        if self._refused:
            lost = Anomaly(part.posted_ns, DISK_TOO_SLOW, "", self._refused)
            part, self._refused = part._replace(anomalies=(lost, *part.anomalies)), 0
        self._parts.append(part)
        self._waiting += len(part.time_ns)


class Feed:
    """Takes parts from the logger's thread; reading them does not delay that thread.

    Attributes:
        lock: Held while a part is passed on.
        followers: The captures that record all readings.
        newest_ns: Time of the newest reading; None before the first.
        newest_sigma_ns: Its σ.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.followers: set[Follower] = set()
        self.newest_ns: int | None = None
        self.newest_sigma_ns: int | None = None
        self._means: StepMeans | None = None
        self._kept: deque[Part] = deque()
        self._count = 0

    def put(self, part: Part) -> None:
        """Passes a part on to all followers, and drops parts that are too old."""
        with self.lock:
            self._kept.append(part)
            self._count += len(part.time_ns)
            if len(part.time_ns):
                self.newest_ns, self.newest_sigma_ns = part.newest_ns, part.time_sigma_ns
                self._means = self._means or StepMeans(part.kpa.shape[1])
                self._means.add(part.time_ns, part.kpa)
            oldest_ns = part.posted_ns - KEPT_NS
            while self._kept and (self._count > MOST_KEPT or self._kept[0].posted_ns < oldest_ns):
                self._count -= len(self._kept.popleft().time_ns)
            for follower in self.followers:
                follower.put(part)

    def follow(self) -> Follower:
        """Follows the feed from now on, including the kept parts."""
        with self.lock:
            follower = Follower(self, list(self._kept))
            self.followers.add(follower)
            return follower

    def newest(self, since_ns: int) -> list[Part]:
        """Parts with readings that came since a time, in order."""
        with self.lock:
            return [one for one in self._kept if one.posted_ns >= since_ns and len(one.time_ns)]

    def means_since(self, since_ns: int, channel: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(K,) middle of each step in which a channel has readings, and (K,) its mean."""
        with self.lock:
            if self._means is None:
                return np.empty(0, np.int64), np.empty(0)
            return self._means.since(since_ns, channel)
