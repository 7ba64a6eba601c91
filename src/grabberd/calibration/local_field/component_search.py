"""Component search: restricted maximum likelihood over a grid that is refined step by step."""

from collections.abc import Iterable
from itertools import product
from typing import TypeAlias

import numpy as np

from grabberd.calibration.local_field.collocation import Collocation, Components

Logs: TypeAlias = tuple[float, ...]

_START = ((-2.0, 0.0), (-0.5, 0.5, 1.5), (-1.0, 0.0), (-6.0, 0.0))
_LIMITS = ((-10.0, 2.0), (-1.0, 3.0), (-5.0, 5.0), (-6.0, 4.0))
"""Binary logarithms: of the signal relative to what the trend leaves, of the length relative to the targets'
distance (shorter ones no target shows, longer ones the global model absorbs), of the σ of noise and positions
relative to the given ones."""
_FINEST = 0.125


def most_likely(collocation: Collocation) -> Components:
    """Find the components of greatest restricted likelihood.

    The σ of noise and positions are estimated as multiples of the given ones: a certificate may be better or
    worse than stated, and only with its true σ can its errors be told from the signal.
    """
    search = _Search(collocation)
    logs = max(search.grid(), key=search.value)
    step = 0.5
    while step >= _FINEST:
        best = max(search.around(logs, step), key=search.value)
        if search.value(best) > search.value(logs):
            logs = best
        else:
            step /= 2
    return search.components(logs)


class _Search:
    """Likelihoods by binary logarithms of the components, each computed once."""

    def __init__(self, collocation: Collocation) -> None:
        self._collocation = collocation
        self._units = _left_px(collocation), _spacing_px(collocation), 1.0, 1.0
        self._axes = 4 if collocation.by_places.any() else 3
        self._known: dict[Logs, float] = {}

    def grid(self) -> Iterable[Logs]:
        """Start values."""
        return product(*_START[: self._axes])

    def around(self, logs: Logs, step: float) -> Iterable[Logs]:
        """Neighbours along each axis, within the limits."""
        for axis, sign in product(range(self._axes), (-1, 1)):
            low, high = _LIMITS[axis]
            moved = min(max(logs[axis] + sign * step, low), high)
            yield (*logs[:axis], moved, *logs[axis + 1 :])

    def value(self, logs: Logs) -> float:
        """Log likelihood, with a prior that the given σ of noise is right to a factor of about two."""
        if logs not in self._known:
            doubt = 0.5 * logs[2] ** 2
            self._known[logs] = self._collocation.likelihood(self.components(logs)) - doubt
        return self._known[logs]

    def components(self, logs: Logs) -> Components:
        """Convert the logarithms to components; held positions have no errors."""
        sizes = [unit * 2.0**log for unit, log in zip(self._units, logs, strict=False)]
        return Components(sizes[0], sizes[1], sizes[2], sizes[3] if self._axes == 4 else 0.0)


def _left_px(collocation: Collocation) -> float:
    """Root mean square of what the trend leaves."""
    step = np.linalg.lstsq(collocation.trend, collocation.misclosure, rcond=None)[0]
    left = collocation.misclosure - collocation.trend @ step
    return float(np.sqrt((left**2).mean()))


def _spacing_px(collocation: Collocation) -> float:
    """Median distance of an image point to its nearest neighbour."""
    apart = collocation.distance_px + np.where(np.eye(len(collocation.network)) > 0, np.inf, 0.0)
    return float(np.median(apart.min(axis=1)))
