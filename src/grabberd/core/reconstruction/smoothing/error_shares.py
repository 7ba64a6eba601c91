"""Error shares: the white part of the points' errors, and the parts locked to the target's sub-pixel
position.

A point's error, apart from the calibration's, has three parts:

- *white*, drawn anew for every field: noise and line jitter;
- *opposite*, locked to the target's position between the pixels, and different for the two parities, which
  see the target on different lines. Same position and parity, same error. Progressive pictures have none;
- *common*, locked likewise, but equal for both parities.

While the object rests, fields of one parity differ by the white part alone, fields of different parity also
by the opposite part. The common part cannot be told from the position: it is taken as a share of the others
that was found with the simulator, and at 1 bit at least as what remains of the points' covariance.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.point_series import PointSeries

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_COMMON = {1: 0.1, 2: 0.26, 3: 0.07}
_COMMON_OF_GREY = 0.022
"""Common part as a share of the scatter of repeated measurements, for few bits and for more; from
simulation."""
_LEAST_WHITE = 0.02
_LEAST_PAIRS = 60
_LEAST_TARGETS = 3
_REST_S = 0.04
"""Time between fields that are compared to tell rest from movement, which is slower than noise."""


@dataclass(frozen=True, slots=True, eq=False)
class ErrorShares:
    """Variances in units of the points' own; their sum is 1 where the points' covariance is right.

    Attributes:
        white: (3,) in X, Y and Z.
        opposite: (3,) likewise.
        common: (3,) likewise.
    """

    white: Array
    opposite: Array
    common: Array

    @classmethod
    def all_white(cls) -> "ErrorShares":
        """Errors that are wholly white."""
        return cls(np.ones(3), np.zeros(3), np.zeros(3))

    @classmethod
    def of(cls, series: PointSeries, rest: Mask, bits: int, *, interlaced: bool = True) -> "ErrorShares":
        """Estimate from the fields in which the object rests; all white if there are too few.

        Args:
            series: The points.
            rest: (F,) True for fields in which the object rests.
            bits: Bits per pixel of the fields that the points come from.
            interlaced: True if they alternate in parity; progressive pictures show the same lines every time.
        """
        same, own = _half_variance(series, 2 if interlaced else 1, rest)
        other, others = _half_variance(series, 1, rest) if interlaced else (same, own)
        if min(own, others) < _LEAST_PAIRS:
            return cls.all_white()
        white = same.clip(_LEAST_WHITE)
        opposite = 0.5 * (other - same).clip(0.0)
        seen = white + opposite
        common = _COMMON.get(bits, _COMMON_OF_GREY) * seen
        return cls(white, opposite, np.maximum(common, 1.0 - seen) if bits == 1 else common)


def rest_fields(series: PointSeries, *, interlaced: bool = True) -> Mask:
    """(F,) True for fields that differ from those around them no more than the quietest do.

    Detecting rest in a single field takes several targets; movements small beside the errors go unnoticed.
    """
    lag = _rest_lag(series, interlaced)
    differ, count = _differences(series, lag)
    if not np.isfinite(differ).any():
        return np.zeros(len(series.n), np.bool_)
    spread = math.sqrt(2.0 / (3.0 * float(np.median(count[count > 0]))))
    quiet = differ <= float(np.nanquantile(differ, 0.1)) * (1.0 + max(1.0, 4.3 * spread))
    rest: Mask = quiet.copy()
    for shift in range(1, lag + 1):
        rest[:-shift] &= quiet[shift:]
    return rest


def _rest_lag(series: PointSeries, interlaced: bool) -> int:
    """Number of fields in `_REST_S`; an even one if they alternate in parity."""
    steps = np.diff(series.n)
    if not len(steps):
        return 2
    period_s = float(np.median(np.diff(series.time_s) / np.maximum(steps, 1)))
    fields = _REST_S / period_s if period_s > 0 else 2.0
    return 2 * max(round(fields / 2), 1) if interlaced else max(round(fields), 1)


def _differences(series: PointSeries, lag: int) -> tuple[Array, NDArray[np.intp]]:
    """(F,) mean squared difference from `lag` fields before, over all targets, in units of the variance.

    NaN where too few targets can be compared; also the number of targets compared.
    """
    squares, both = _squares(series, lag)
    count = both.sum(axis=1)
    total = np.where(both[..., np.newaxis], squares, 0.0).sum(axis=(1, 2)) / 3.0
    differ = np.full(len(series.n), np.nan)
    enough = count >= min(_LEAST_TARGETS, len(series.target))
    differ[enough] = total[enough] / count[enough]
    return differ, count


def _half_variance(series: PointSeries, lag: int, rest: Mask) -> tuple[Array, int]:
    """(3,) mean of half the squared differences of fields `lag` steps apart, and their number."""
    squares, both = _squares(series, lag)
    both &= rest[:, np.newaxis]
    return (squares[both].mean(axis=0) if both.any() else np.ones(3)), int(both.sum())


def _squares(series: PointSeries, lag: int) -> tuple[Array, Mask]:
    """(F, T, 3) half the squared difference from `lag` steps before, in units of the variance."""
    earlier = np.searchsorted(series.n, series.n - lag)
    there = series.n[earlier] == series.n - lag
    both = series.seen & series.seen[earlier] & there[:, np.newaxis]
    variance = np.diagonal(series.covariance_mm2, axis1=2, axis2=3)
    squares: Array = 0.5 * (series.xyz_mm - series.xyz_mm[earlier]) ** 2 / variance
    return squares, both
