"""How long it took from a field's arrival until its points were published."""

import threading

import numpy as np
from numpy.typing import NDArray

KEPT = 32768


class Latency:
    """The latest ten minutes of latencies at 50 Hz."""

    def __init__(self) -> None:
        self._kept: NDArray[np.int64] = np.zeros(KEPT, np.int64)
        self._count = 0
        self._lock = threading.Lock()

    def add(self, latency_ns: int) -> None:
        """Enters one field's latency."""
        with self._lock:
            self._kept[self._count % KEPT] = latency_ns
            self._count += 1

    def milliseconds(self, latest: int = KEPT) -> NDArray[np.float64]:
        """(N,) float64, the newest of them, at most `latest`, in no particular order."""
        with self._lock:
            count = min(self._count, latest, KEPT)
            index = (self._count - 1 - np.arange(count)) % KEPT
            return self._kept[index] / 1e6

    def percentiles_ms(self, latest: int = KEPT) -> dict[str, float] | None:
        """p50, p99 and max of the newest; None where there are none."""
        values = self.milliseconds(latest)
        if not len(values):
            return None
        p50, p99 = np.percentile(values, (50, 99))
        return {"p50": float(p50), "p99": float(p99), "max": float(values.max())}
