"""Component search: restricted maximum likelihood over a grid that is refined step by step."""

import math
from collections.abc import Iterable
from itertools import product
from typing import TypeAlias

import numpy as np

from grabberd.core.calibration.local_field.collocation import Collocation, Components

Logs: TypeAlias = tuple[float, ...]

_LENGTH, _NOISE, _PLACE = 1, 2, 3
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
    return search.components(search.best())


def evidence_of(collocation: Collocation, components: Components) -> float:
    """Log likelihood of the most likely components over that of the best signal without any correlation."""
    search = _Search(collocation)
    alone = _Search(collocation, alone=True)
    return search.value_of(components) - alone.value(alone.best())


class _Search:
    """Likelihoods by binary logarithms of the components, each computed once; `alone`: of a signal that no
    two image points share, which stands for all noise.
    """

    def __init__(self, collocation: Collocation, *, alone: bool = False) -> None:
        self._collocation = collocation
        self._units = _left_px(collocation), _spacing_px(collocation), 1.0, 1.0
        axes = range(4 if collocation.by_places.any() else 3)
        self._axes = [axis for axis in axes if not (alone and axis in (_LENGTH, _NOISE))]
        self._alone = alone
        self._known: dict[Logs, float] = {}

    def best(self) -> Logs:
        """The best of the start values, improved until no neighbour is better."""
        logs, step = max(self.grid(), key=self.value), 0.5
        while step >= _FINEST:
            best = max(self.around(logs, step), key=self.value)
            if self.value(best) > self.value(logs):
                logs = best
            else:
                step /= 2
        return logs

    def grid(self) -> Iterable[Logs]:
        """Start values."""
        return product(*(start if axis in self._axes else (0.0,) for axis, start in enumerate(_START)))

    def around(self, logs: Logs, step: float) -> Iterable[Logs]:
        """Neighbours along each axis, within the limits."""
        for axis, sign in product(self._axes, (-1, 1)):
            low, high = _LIMITS[axis]
            moved = min(max(logs[axis] + sign * step, low), high)
            yield (*logs[:axis], moved, *logs[axis + 1 :])

    def value(self, logs: Logs) -> float:
        """Log likelihood, with a prior that the given σ of noise is right to a factor of about two."""
        if logs not in self._known:
            self._known[logs] = self.value_of(self.components(logs))
        return self._known[logs]

    def value_of(self, components: Components) -> float:
        """The same of components."""
        return self._collocation.likelihood(components) - 0.5 * math.log2(components.noise) ** 2

    def components(self, logs: Logs) -> Components:
        """Convert the logarithms to components; held positions have no errors."""
        sizes = [unit * 2.0**log for unit, log in zip(self._units, logs, strict=False)]
        found = Components(sizes[0], sizes[1], sizes[2], sizes[3] if _PLACE in self._axes else 0.0)
        return found.uncorrelated if self._alone else found


def _left_px(collocation: Collocation) -> float:
    """Root mean square of what the trend leaves."""
    step = np.linalg.lstsq(collocation.trend, collocation.misclosure, rcond=None)[0]
    left = collocation.misclosure - collocation.trend @ step
    return float(np.sqrt((left**2).mean()))


def _spacing_px(collocation: Collocation) -> float:
    """Median distance of an image point to its nearest neighbour."""
    apart = collocation.distance_px + np.where(np.eye(len(collocation.network)) > 0, np.inf, 0.0)
    return float(np.median(apart.min(axis=1)))
