"""How large targets appear, part by part of the picture, and how high the threshold is among them.

One blob's size tells little: it jumps by whole pixels. The mean over neighbours tells the size to a fraction
of a pixel, and it follows tilt and distance over the picture.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.measurement.locale_model import Appearance, log_odds
from grabberd.measurement.runs import Runs

Array = NDArray[np.float64]

CELLS_X, CELLS_Y = 8, 6
"""Parts of the picture whose blobs are taken together; no part has blobs of both halves."""
BORROWED = 4.0
"""So many blobs of the whole field's mean are added to each part's own."""
STEP_PX = 0.1
"""Half axes and lean are rounded to this, so that few tables are needed."""
POINTING_PX2 = (0.009, 0.013)
"""What the error of its own centre takes off a blob's moments, per `y_step` in x and its square in y."""
NOMINAL_FRACTION = 0.3
"""Of the contrast, where the threshold's height is not known otherwise."""
FRACTIONS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)
PRIOR_BLOBS = 8.0


class Sizes(NamedTuple):
    """Half axes in frame pixels and lean of N blobs' surroundings, in units of `STEP_PX`: (N,) int64 each."""

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
    """The sizes round every blob.

    Args:
        moments: of N blobs.
        counted: (N,) which of them look like targets and so count for the means.
        centres: (N, 2) columns and rows.
        packed: the field they are in.
    """
    part = _part(centres, packed)
    sums = np.stack([np.bincount(part, values * counted, CELLS_X * CELLS_Y) for values in moments])
    blobs = np.maximum(np.count_nonzero(counted), 1)
    total = sums + (BORROWED / blobs) * sums.sum(axis=1, keepdims=True)
    xx, yy, xy = total[1:] / np.maximum(total[0], 1e-9)
    yy = yy + POINTING_PX2[1] * packed.y_step**2
    half_width = 2 * np.sqrt(np.maximum(xx + POINTING_PX2[0] * packed.y_step - xy * xy / yy, 0.25))
    found = np.stack([half_width, 2 * np.sqrt(np.maximum(yy, 0.25)), xy / yy])
    return Sizes(*np.rint(found / STEP_PX).astype(np.int64)[:, part])


def _part(centres: Array, packed: PackedField) -> NDArray[np.int64]:
    across = np.floor(centres * (CELLS_X / packed.columns, CELLS_Y / packed.rows)).astype(np.int64)
    part: NDArray[np.int64] = across[:, 0] + across[:, 1] * CELLS_X
    return part


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
    half_axes = (float(np.mean(axis[counted])) if counted.any() else 1.0 for axis in sizes[:2])
    width, height = (STEP_PX * round(axis) for axis in half_axes)
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
