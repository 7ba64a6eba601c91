"""Apparent size of targets over the picture, and the threshold's share of their contrast.

One blob's size says little, since it jumps by whole pixels. A smooth surface through all of them gives the
size to a fraction of a pixel and follows tilt and distance over the picture.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling import Runs
from grabberd.core.measurement.locale_table import Appearance, log_odds

Array = NDArray[np.float64]

STIFFNESS = 6.0
"""Weight in blobs by which a half's mean keeps its surface flat where only few blobs say otherwise."""
HELD = np.diag([0.0, 1, 1, 1, 1, 1])
ROUNDED_PX = 0.15
"""Step to which half axes are rounded when computing `fullness`, so that few values are needed."""
POINTING_PX2 = (0.009, 0.013)
"""Bias of a blob's moments by the error of its own centre, per `y_step` in x and its square in y."""
LEAST_PX2 = 0.25
"""Least second moment of a target."""
NOMINAL_FRACTION = 0.3
"""Threshold's share of the contrast if it is not known otherwise."""
FRACTIONS = (0.12, 0.2, 0.3, 0.42)
PRIOR_BLOBS = 8.0
"""Weight of the nominal fraction, in blobs."""


class Sizes(NamedTuple):
    """Smoothed half axes (frame pixels) and lean at N blobs: (N,) float64 each."""

    half_width_px: Array
    half_height_px: Array
    lean: Array


class Moments(NamedTuple):
    """Sums over the pixels of N blobs, relative to each one's centre, in frame pixels: (N,) float64 each."""

    pixels: Array
    xx: Array
    yy: Array
    xy: Array


def moments_of(packed: PackedField, runs: Runs, label: NDArray[np.int64], centres: Array) -> Moments:
    """Compute second moments of every component about its `centres` (columns, rows), from delivered rows
    only.
    """
    count, y_step = len(centres), packed.y_step
    length = np.where(is_delivered(packed, runs.row), runs.last - runs.first + 1.0, 0.0)
    x = (runs.first + runs.last) / 2 - centres[label, 0]
    y = (runs.row - centres[label, 1]) * y_step
    within = (length * length - 1) / 12
    sums = (length, length * (x * x + within), length * y * y, length * x * y)
    return Moments(*(np.asarray(np.bincount(label, values, count), np.float64) for values in sums))


def is_delivered(packed: PackedField, row: NDArray[np.int64]) -> NDArray[np.bool_]:
    """True for rows that the camera delivered; the others of a doubled field are interpolated."""
    return (row & 1) == packed.parity if packed.is_doubled else row >= 0


def sizes_of(moments: Moments, counted: NDArray[np.bool_], centres: Array, packed: PackedField) -> Sizes:
    """Smooth the sizes of blobs by a quadratic over each half of the picture.

    Args:
        moments: Moments of N blobs.
        counted: (N,) True for blobs that look like targets and so count.
        centres: (N, 2) columns and rows.
        packed: The field.
    """
    xx, yy, xy = _smoothed(np.array(moments) * counted, centres, packed.columns)
    yy = np.maximum(yy + POINTING_PX2[1] * packed.y_step**2, LEAST_PX2)
    across = np.maximum(xx + POINTING_PX2[0] * packed.y_step - xy * xy / yy, LEAST_PX2)
    return Sizes(2 * np.sqrt(across), 2 * np.sqrt(yy), xy / yy)


def _smoothed(moments: Array, centres: Array, columns: int) -> Array:
    """(3, N) second moments per pixel, from surfaces through `moments` (4, N) over each half."""
    right = centres[:, 0] >= (columns - 1) / 2
    weight = moments[0] * np.array([~right, right])
    counted = weight > 0
    total = np.maximum(weight.sum(axis=1), 1e-9)
    blobs = np.maximum(counted.sum(axis=1), 1)
    terms = _terms(centres, weight / total[:, np.newaxis], right.astype(np.int64))
    held = (STIFFNESS * total / blobs)[:, np.newaxis, np.newaxis] * HELD
    # Keeps the equations regular for a half without a single blob.
    held[:, 0, 0] = 1e-9
    normal = (terms * weight[:, np.newaxis]) @ terms.T + held
    own = moments[1:] * counted[:, np.newaxis]
    mean = own.sum(axis=2, keepdims=True) / total[:, np.newaxis, np.newaxis]
    factors = np.linalg.solve(normal, terms @ (own - mean * weight[:, np.newaxis]).swapaxes(1, 2))
    left, other = factors.swapaxes(1, 2) @ terms + mean
    return np.where(right, other, left)


def _terms(centres: Array, share: Array, half: NDArray[np.int64]) -> Array:
    """(6, N) terms of a quadratic over each blob's half, whose extent follows from the `share` (2, N)."""
    middle = share @ centres
    extent = np.sqrt(np.maximum(share @ (centres * centres) - middle * middle, 1.0))
    x, y = ((centres - middle[half]) / extent[half]).T
    # Squares less their mean of 1 leave the constant, which nothing holds, the mean size.
    return np.array([np.ones_like(x), x, y, x * y, x * x - 1, y * y - 1])


def threshold_fraction(
    pixels: NDArray[np.int64], delivered: Moments, sizes: Sizes, counted: NDArray[np.bool_], spread_px: float
) -> float:
    """Estimate the threshold's share of the contrast in a doubled field, one of `FRACTIONS`.

    Interpolated rows are blurred: at a low threshold more of their pixels are set than in the rows between
    them, at a high one fewer.

    Args:
        pixels: (N,) pixels of each component.
        delivered: Moments of its delivered rows.
        sizes: Smoothed size at it.
        counted: (N,) True if it counts.
        spread_px: Standard deviation of the spread function.
    """
    if not counted.any():
        return NOMINAL_FRACTION
    sums = np.array([*sizes[:2], delivered.pixels, pixels])[:, counted].sum(axis=1)
    blobs = int(np.count_nonzero(counted))
    across, down, of_delivered, of_all = sums.tolist()
    width, height = (ROUNDED_PX * round(one / blobs / ROUNDED_PX) for one in (across, down))
    ratios = fullness((width, height), spread_px)
    prior = PRIOR_BLOBS * of_delivered / blobs
    prior_interpolated = prior * ratios[FRACTIONS.index(NOMINAL_FRACTION)]
    ratio = (of_all - of_delivered + prior_interpolated) / (of_delivered + prior)
    return min(zip(ratios, FRACTIONS, strict=True), key=lambda pair: abs(pair[0] - ratio))[1]


@lru_cache(maxsize=64)
def fullness(half_axes_px: tuple[float, float], spread_px: float) -> tuple[float, ...]:
    """Ratio of set pixels in interpolated rows to those in delivered rows, at each of `FRACTIONS`."""
    half_width, half_height = half_axes_px
    looks = [Appearance(half_width, half_height, one, 1.0, spread_px, 0.0, 1) for one in FRACTIONS]
    x, y = np.arange(0.05, half_width + 2, 0.1), np.arange(0.05, half_height + 3, 0.1)
    odds = [log_odds(look, x, y) for look in looks]
    return tuple(_set(one.interpolated) / max(1, _set(one.delivered)) for one in odds)


def _set(odds: Array) -> int:
    return int(np.count_nonzero(odds > 0))
