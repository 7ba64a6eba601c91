"""The line under a cloud of delays: what they would be if nothing had held any of them up.

A delay can be too long by any amount and never too short, so means and least squares are biased by the load
of the computer. The line sought lies under all delays and touches the shortest of them.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

USUAL_DRIFT = 1e-4
"""Drift that crystals reach. Ceramic resonators drift fifty times as much: unlikely, not impossible."""
_LEAST = 5
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
    slopes = np.array([0.0, *(_hull_slopes(x, y) if len(x) >= _LEAST else ())])
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
