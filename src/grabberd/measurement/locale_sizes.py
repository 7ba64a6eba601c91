"""How large targets appear over the picture, and how high the threshold is among them.

One blob's size tells little: it jumps by whole pixels. A smooth surface through all of them tells the size to
a fraction of a pixel, and it follows tilt and distance over the picture.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.measurement.locale_model import Appearance, log_odds
from grabberd.measurement.runs import Runs

Array = NDArray[np.float64]

STIFFNESS = 6.0
"""So many blobs' worth of a half's mean hold its surface even where few blobs say otherwise."""
STEPS = (0.15, 0.15, 0.2)
"""Half width, half height (frame pixels) and lean are rounded to these, so that few tables are needed."""
POINTING_PX2 = (0.009, 0.013)
"""What the error of its own centre takes off a blob's moments, per `y_step` in x and its square in y."""
LEAST_PX2 = 0.25
"""Least second moment of a target."""
NOMINAL_FRACTION = 0.3
"""Of the contrast, where the threshold's height is not known otherwise."""
FRACTIONS = (0.12, 0.2, 0.3, 0.42)
PRIOR_BLOBS = 8.0


class Sizes(NamedTuple):
    """Half axes and lean of N blobs' surroundings, in units of `STEPS`: (N,) int64 each."""

    half_width: NDArray[np.int64]
    half_height: NDArray[np.int64]
    lean: NDArray[np.int64]


class Moments(NamedTuple):
    """Sums over the pixels of N blobs, relative to each one's centre, in frame pixels: (N,) float64 each."""

    pixels: Array
    xx: Array
    yy: Array
    xy: Array


def moments_of(packed: PackedField, runs: Runs, label: NDArray[np.int64], centres: Array) -> Moments:
    """Second moments of every component about its `centres` (columns, rows), of delivered rows alone."""
    count, y_step = len(centres), packed.y_step
    length = np.where(is_delivered(packed, runs.row), runs.last - runs.first + 1.0, 0.0)
    x = (runs.first + runs.last) / 2 - centres[label, 0]
    y = (runs.row - centres[label, 1]) * y_step
    within = (length * length - 1) / 12
    sums = (length, length * (x * x + within), length * y * y, length * x * y)
    return Moments(*(np.bincount(label, values, count).astype(np.float64) for values in sums))


def is_delivered(packed: PackedField, row: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which rows the camera delivered; the others of a doubled field are interpolated."""
    delivered: NDArray[np.bool_] = (row - packed.parity) % 2 == 0 if packed.y_step == 1 else row >= 0
    return delivered


def sizes_of(moments: Moments, counted: NDArray[np.bool_], centres: Array, packed: PackedField) -> Sizes:
    """The sizes round every blob, which change as a quadratic over each half of the picture.

    Args:
        moments: of N blobs.
        counted: (N,) which of them look like targets and so count.
        centres: (N, 2) columns and rows.
        packed: the field they are in.
    """
    smooth = np.empty((3, len(centres)))
    right = centres[:, 0] >= (packed.columns - 1) / 2
    for half in (right, ~right):
        weight = moments.pixels[half] * counted[half]
        sums = np.stack(moments[1:])[:, half] * counted[half]
        smooth[:, half] = _smoothed(_terms(centres[half], weight), weight, sums)
    xx, yy, xy = smooth
    yy = np.maximum(yy + POINTING_PX2[1] * packed.y_step**2, LEAST_PX2)
    across = np.maximum(xx + POINTING_PX2[0] * packed.y_step - xy * xy / yy, LEAST_PX2)
    found = np.stack([2 * np.sqrt(across), 2 * np.sqrt(yy), xy / yy])
    return Sizes(*np.rint(found / np.array(STEPS)[:, np.newaxis]).astype(np.int64))


def _terms(centres: Array, weight: Array) -> Array:
    """(N, 6) of a quadratic over the extent of those blobs that weigh."""
    total = max(float(weight.sum()), 1e-9)
    from_middle = centres - weight @ centres / total
    extent = np.sqrt(np.maximum(weight @ (from_middle * from_middle) / total, 1.0))
    x, y = (from_middle / extent).T
    return np.stack([np.ones_like(x), x, y, x * y, x * x - 1, y * y - 1], axis=1)


def _smoothed(terms: Array, weight: Array, sums: Array) -> Array:
    """(K, N) surfaces through the ratios of `sums` (K, N) to `weight` (N,)."""
    total = max(float(weight.sum()), 1e-9)
    mean = sums.sum(axis=1) / total
    blobs = max(1, int(np.count_nonzero(weight)))
    held = STIFFNESS * total / blobs * np.diag([0.0, 1, 1, 1, 1, 1])
    held[0, 0] = 1e-9
    normal = (terms * weight[:, np.newaxis]).T @ terms + held
    right = (sums - mean[:, np.newaxis] * weight) @ terms
    smooth: Array = np.linalg.solve(normal, right.T).T @ terms.T + mean[:, np.newaxis]
    return smooth


def threshold_fraction(
    pixels: NDArray[np.int64], delivered: Moments, sizes: Sizes, counted: NDArray[np.bool_], spread_px: float
) -> float:
    """The threshold's share of the contrast in a doubled field, one of `FRACTIONS`.

    Interpolated rows are blurred: at a low threshold more of their pixels are set than of the rows between
    them, at a high one fewer.

    Args:
        pixels: (N,) of each component.
        delivered: its moments, of delivered rows.
        sizes: round it.
        counted: whether it counts.
        spread_px: standard deviation of the spread function.
    """
    width, height = (
        step * round(float(np.mean(axis[counted])) if counted.any() else 10.0)
        for step, axis in zip(STEPS, sizes[:2], strict=False)
    )
    ratios = np.array(fullness((width, height), spread_px))
    rows = delivered.pixels[counted]
    prior = PRIOR_BLOBS * (rows.mean() if len(rows) else 1.0)
    interpolated = pixels[counted].sum() - rows.sum()
    ratio = (interpolated + prior * ratios[FRACTIONS.index(NOMINAL_FRACTION)]) / (rows.sum() + prior)
    return FRACTIONS[int(np.abs(ratios - ratio).argmin())]


@lru_cache(maxsize=64)
def fullness(half_axes_px: tuple[float, float], spread_px: float) -> tuple[float, ...]:
    """How many pixels of interpolated rows are set for each one of delivered rows, at each of `FRACTIONS`."""
    half_width, half_height = half_axes_px
    looks = [Appearance(half_width, half_height, 0.0, one, 1.0, spread_px, 0.0, 1) for one in FRACTIONS]
    x, y = np.arange(0.05, half_width + 2, 0.1), np.arange(0.05, half_height + 3, 0.1)
    odds = [log_odds(look, x, y) for look in looks]
    return tuple(_set(one.interpolated) / max(1, _set(one.delivered)) for one in odds)


def _set(odds: Array) -> int:
    return int(np.count_nonzero(odds > 0))
