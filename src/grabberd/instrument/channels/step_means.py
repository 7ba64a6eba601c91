"""Means of a logger's readings over short steps of time, for the last minutes."""

import numpy as np
from numpy.typing import NDArray

STEP_NS = 20_000_000
"""Time over which readings are averaged, short beside a pulsation, whatever the camera's rate."""
STEPS = 15_000
"""Five minutes: 120 kB, and 180 kB for each channel."""


class StepMeans:
    """A ring of steps; each has its place by its time, so that a gap stays one.

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
        """(K,) middle of each step since a time in which the channel said something, and (K,) its mean."""
        found = np.flatnonzero((self._step >= time_ns // STEP_NS) & (self._count[:, channel] > 0))
        found = found[np.argsort(self._step[found])]
        means = self._sum[found, channel] / self._count[found, channel]
        return self._step[found] * STEP_NS + STEP_NS // 2, means
