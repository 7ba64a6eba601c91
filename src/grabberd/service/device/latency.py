"""Latency from a field's arrival until its points were published."""

import threading
from bisect import bisect_left
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

KEPT = 32768
"""Ten minutes at 50 Hz, rounded up to a power of two."""
BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28)
"""Upper bounds of the histogram's classes; 32 slots of the ring last 0.64 s."""


class Histogram(NamedTuple):
    """All latencies since the start.

    Attributes:
        counts: Number of latencies in each class of `BOUNDS_S`, and beyond the last.
        sum_s: Their sum.
    """

    counts: tuple[int, ...]
    sum_s: float


class Latency:
    """The latest ten minutes of latencies at 50 Hz, and a histogram of all."""

    def __init__(self) -> None:
        self._kept: NDArray[np.int64] = np.zeros(KEPT, np.int64)
        self._count = 0
        self._classes = [0] * (len(BOUNDS_S) + 1)
        self._sum_ns = 0
        self._lock = threading.Lock()

    def add(self, latency_ns: int) -> None:
        """Adds one field's latency."""
        with self._lock:
            self._kept[self._count % KEPT] = latency_ns
            self._count += 1
            self._classes[bisect_left(BOUNDS_S, latency_ns / 1e9)] += 1
            self._sum_ns += latency_ns

    @property
    def histogram(self) -> Histogram:
        """Histogram of all latencies since the start."""
        with self._lock:
            return Histogram(tuple(self._classes), self._sum_ns / 1e9)

    def milliseconds(self, latest: int = KEPT) -> NDArray[np.float64]:
        """(N,) float64, the newest latencies, at most `latest`, in no particular order."""
        with self._lock:
            count = min(self._count, latest, KEPT)
            index = (self._count - 1 - np.arange(count)) % KEPT
            return self._kept[index] / 1e6

    def percentiles_ms(self, latest: int = KEPT) -> dict[str, float] | None:
        """p50, p99 and max of the newest; None if there are none."""
        values = self.milliseconds(latest)
        if not len(values):
            return None
        p50, p99 = np.percentile(values, (50, 99))
        return {"p50": float(p50), "p99": float(p99), "max": float(values.max())}
