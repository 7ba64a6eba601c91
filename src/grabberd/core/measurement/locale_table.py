"""Appearance of a target at 1 bit, and tables of log likelihoods over its positions, summed over runs.

A disc is a stack of chords, blurred by a Gaussian and by the pixels that collect the light; all lengths are
in frame pixels, light is in units of the contrast. Given the position, bits are independent: the log
likelihood is one constant for an empty picture and, for each run, the log odds of its pixels. These are
cumulated along the rows, so that a run needs only its two ends. Positions form a fine grid through the whole
picture, so a table depends only on where an end is relative to the target.

Apparent size of targets over the picture, and the threshold's share of their contrast.

One blob's size says little, since it jumps by whole pixels. A smooth surface through all of them gives the
size to a fraction of a pixel and follows tilt and distance over the picture.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Mask
from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling import Runs

CHORDS = 20
LINE_HEIGHT_PX = 1.6
"""Compromise between a field's row that collects one frame line and a sensor that integrates two."""
SURE = 6.9
"""Greatest log odds of a pixel: one in a thousand is wrong for reasons outside the model."""
_NEWTON_STEPS = 6


class Appearance(NamedTuple):
    """Properties other than position that decide the bits of a target.

    Attributes:
        half_width_px: Half the width of the region above the threshold.
        half_height_px: Half its height.
        fraction: The threshold's share of the contrast.
        noise: Standard deviation of a pixel on a delivered line, in contrasts.
        spread_px: Standard deviation of the spread function.
        jitter_px: Standard deviation of a line's shift.
        y_step: Frame lines from row to row.
        lines_apart: Frame lines from one delivered line to the next: rows between them are interpolated.
    """

    half_width_px: float
    half_height_px: float
    fraction: float
    noise: float
    spread_px: float
    jitter_px: float
    y_step: int
    lines_apart: int = 2

    @property
    def doubled(self) -> bool:
        """True if every other row is interpolated."""
        return self.y_step < self.lines_apart

    def of_size(self, half_width_px: float, half_height_px: float) -> "Appearance":
        """The same for targets of another size."""
        return Appearance(half_width_px, half_height_px, *self[2:])

    @property
    def blur_px(self) -> tuple[float, float]:
        """Standard deviation of spread and pixel combined, in x and y."""
        pixel = 12**-0.5
        height_px = 1.0 if self.lines_apart == 1 else LINE_HEIGHT_PX
        return math.hypot(self.spread_px, pixel), math.hypot(self.spread_px, height_px * pixel)


def normal_share(z: Array) -> Array:
    """Normal distribution function, accurate to 2e-4."""
    return 1 / (1 + np.exp(-normal_log_odds(np.clip(z, -8.0, 8.0))))


def normal_log_odds(z: Array) -> Array:
    """Log odds of a standard normal variable being below z, by the usual cubic approximation."""
    return z * (1.5976 + 0.070566 * z * z)


def light(half_axes_px: tuple[float, float], blur_px: tuple[float, float], x: Array, y: Array) -> Array:
    """(len(y), len(x)) light of an ellipse around the origin at the points of a grid."""
    half_width, half_height = half_axes_px
    angle = (np.arange(CHORDS) + 0.5) * (np.pi / CHORDS) - np.pi / 2
    height, reach = half_height * np.sin(angle), half_width * np.cos(angle)
    x = x[:, np.newaxis]
    along = normal_share((x + reach) / blur_px[0]) - normal_share((x - reach) / blur_px[0])
    thickness = half_height * np.cos(angle) * (np.pi / CHORDS)
    across = np.exp(-0.5 * ((y[:, np.newaxis] - height) / blur_px[1]) ** 2) * thickness
    return across @ along.T / (blur_px[1] * math.sqrt(2 * math.pi))


@lru_cache(maxsize=256)
def half_axes_px(
    seen_px: tuple[float, float], fraction: float, blur_px: tuple[float, float]
) -> tuple[float, float]:
    """Half axes of the ellipse whose light falls to `fraction` at the half axes seen."""
    wanted = np.array(seen_px)
    axes, origin = wanted.copy(), np.zeros(1)
    # A fixed slope, a little below the .40/σ of a straight edge: converging needs no derivative.
    slope = 0.35 / np.array(blur_px)
    for _ in range(_NEWTON_STEPS):
        both = (float(axes[0]), float(axes[1]))
        right = light(both, blur_px, wanted[:1], origin)[0, 0]
        below = light(both, blur_px, origin, wanted[1:])[0, 0]
        axes = np.maximum(axes + (fraction - np.array([right, below])) / slope, 0.5)
    return float(axes[0]), float(axes[1])


class Odds(NamedTuple):
    """Log odds of a pixel being set, by its position relative to the target.

    Attributes:
        delivered: (V, U) for rows that the camera delivered.
        interpolated: (V, U) for rows that are the mean of their neighbours, one frame line away each.
    """

    delivered: Array
    interpolated: Array


def log_odds(seen: Appearance, x: Array, y: Array) -> Odds:
    """Compute log odds over an even grid of pixel positions relative to the target's centre, U in x, V in y.

    A frame line is a whole number of grid steps.
    """
    axes = half_axes_px((seen.half_width_px, seen.half_height_px), seen.fraction, seen.blur_px)
    line = round(1 / (y[1] - y[0]))
    beyond = np.arange(1, line + 1) / line
    further = np.concatenate([y[0] - beyond[::-1], y, y[-1] + beyond])
    picture = light(axes, seen.blur_px, x, further)
    step = float(x[1] - x[0])
    return Odds(
        _odds_of(picture[line:-line], step, seen, 1.0),
        _odds_of((picture[: -2 * line] + picture[2 * line :]) / 2, step, seen, 0.5),
    )


def _odds_of(picture: Array, step_px: float, seen: Appearance, share: float) -> Array:
    """Log odds with the threshold blurred by noise and the row's shift; a mean of two rows halves the
    variance.
    """
    shifted = np.gradient(picture, step_px, axis=1) * seen.jitter_px
    deviation = np.sqrt(share * (seen.noise**2 + shifted * shifted))
    z = np.clip((picture - seen.fraction) / deviation, -4.0, 4.0)
    return np.clip(normal_log_odds(z), -SURE, SURE)


Single = NDArray[np.float32]
Whole = NDArray[np.int64]

STEPS_X = 10
"""Grid positions per pixel in x; `STEPS_Y`: per frame line in y."""
STEPS_Y = 8
REACH_X = 4
"""Grid steps searched either side of the centroid in x; `REACH_Y` in y, by `y_step`."""
REACH_Y = {1: 4, 2: 6}
BEYOND_PX = 4
"""Pixels by which a table extends beyond the half axes; pixels further away are ignored."""
CAPS = STEPS_X + 2 * REACH_X
"""Steps of x in the parts for the space above and below, which repeat pixel by pixel."""
TABLES = 192
"""Tables kept, some 300 kB each: the sizes, noises and thresholds of the liner's fields need about a
hundred."""


@lru_cache(maxsize=2)
def moments(y_step: int) -> Single:
    """(G, 5) 1, x, y, x², y² of the positions searched, relative to the middle one, frame pixels.

    Ordered as the windows of a `Table`: from the right and from below.
    """
    x, y = np.mgrid[-REACH_X : REACH_X + 1, -REACH_Y[y_step] : REACH_Y[y_step] + 1].reshape(2, -1)
    xy_px = np.stack([-x / STEPS_X, -y / STEPS_Y]).astype(np.float32)
    return np.concatenate([np.ones_like(xy_px[:1]), xy_px, xy_px * xy_px]).T


class Table(NamedTuple):
    """Log likelihoods of w · h positions around a middle one, as windows into fine grids.

    The grid maps a run's end to the number of its window. The half of a row to the left of a target is
    decided by the run's start, the other by its end.

    Attributes:
        windows: (entries, w, h) float32, overlapping views of one array.
        grid: Layout of the entries.
    """

    windows: Single
    grid: "Grid"


def _extent(half_axis_px: float) -> int:
    """Whole pixels or frame lines from the middle that suffice for targets of this half axis."""
    return math.ceil(half_axis_px) + BEYOND_PX


class Grid(NamedTuple):
    """Layout of table entries, for one table or for many at once: by parts, columns, rows.

    The parts are a row's start and end, each for delivered and then for interpolated rows, and likewise the
    space above and below.

    Attributes:
        columns: Steps of x in the parts of starts and ends.
        rows: Steps of y in all parts.
        right: Step of x at position 0.
        down: Step of y at position 0.
        ahead_x: Number of windows that begin in a part along x.
        ahead_y: Likewise along y.
        empty: The last entry, all zeros.
    """

    columns: Whole | int
    rows: Whole | int
    right: Whole | int
    down: Whole | int
    ahead_x: Whole | int
    ahead_y: Whole | int
    empty: Whole | int

    @classmethod
    @lru_cache(maxsize=TABLES)
    def of(cls, half_width_px: float, half_height_px: float, y_step: int) -> "Grid":
        """Layout of all tables for targets of these half axes."""
        columns, rows = 2 * _extent(half_width_px) * STEPS_X, 2 * _extent(half_height_px) * STEPS_Y
        return cls(
            columns,
            rows,
            right=REACH_X - columns // 2,
            down=REACH_Y[y_step] - rows // 2,
            ahead_x=columns - 2 * REACH_X,
            ahead_y=rows - 2 * REACH_Y[y_step],
            empty=4 * (columns + CAPS) * rows,
        )

    def entry_of_cut(self, part: int, interpolated: Whole, x: Whole, row: Whole) -> Whole:
        """Entry of a row's start (part 0) or end (1), at steps of x from the middle; `row` as from
        `row_of`.
        """
        column = np.minimum(np.maximum(x - self.right, 0), self.ahead_x - 1)
        return ((2 * part + interpolated) * self.columns + column) * self.rows + row

    def entry_of_cap(self, part: int, interpolated: Whole, phase: Whole, row: Whole) -> Whole:
        """Entry of the space above the top row (part 0) or below the bottom row (1), by the steps to any
        pixel.
        """
        column = 4 * self.columns + (2 * part + interpolated) * CAPS + (phase - self.right) % STEPS_X
        return np.asarray(column * self.rows + row, np.int64)

    def row_of(self, y: Whole) -> Whole:
        """Index of rows that many steps below the middle."""
        return np.asarray(np.minimum(np.maximum(y - self.down, 0), self.ahead_y - 1), np.int64)


@lru_cache(maxsize=TABLES)
def table(seen: Appearance) -> Table:
    """Make or recall the table of an appearance."""
    return new_table(seen)


def new_table(seen: Appearance) -> Table:
    """Make the table of an appearance without keeping it."""
    columns, lines = _extent(seen.half_width_px), _extent(seen.half_height_px)
    u = np.arange(-columns * STEPS_X, columns * STEPS_X)
    v = np.arange(-lines * STEPS_Y, lines * STEPS_Y)
    odds = np.stack(log_odds(seen, u / STEPS_X, v / STEPS_Y))
    unset = -np.log1p(np.exp(odds))
    right = (u / STEPS_X + 0.5).clip(0.0, 1.0)
    starts = _starts(odds * (1.0 - right), unset * (1.0 - right))
    ends = _ends(odds * right, unset * right)
    beyond = ((0, 0), (0, 0), (0, CAPS - STEPS_X))
    caps = (np.pad(one, beyond, mode="wrap") for one in _caps(unset, seen.y_step, seen.lines_apart))
    size = 2 * REACH_X + 1, 2 * REACH_Y[seen.y_step] + 1
    return Table(
        _windows((starts, ends, *caps), len(v), size),
        Grid.of(seen.half_width_px, seen.half_height_px, seen.y_step),
    )


def _windows(parts: Sequence[Array], rows: int, size: tuple[int, int]) -> Single:
    """All windows of the parts, stored by columns: windows are higher than wide, and long copies are fast."""
    span = (size[0] - 1) * rows + size[1]
    values = np.concatenate(
        [*(one.swapaxes(1, 2).ravel() for one in parts), np.zeros(span)], dtype=np.float32
    )
    shape, strides = (len(values) - span + 1, *size), (4, 4 * rows, 4)
    return as_strided(values, shape, strides, writeable=False)


def _ends(odds: Array, unset: Array) -> Array:
    """(2, V, U) log likelihood of all pixels of a row, given a run's end; those to its left are set."""
    of_pixels, of_unset = _by_pixel(odds), _by_pixel(unset)
    left = np.cumsum(of_pixels, axis=2) - of_pixels
    return (left + of_unset.sum(axis=2, keepdims=True)).reshape(odds.shape)


def _starts(odds: Array, unset: Array) -> Array:
    """Likewise given its start; that pixel and those to its right are set."""
    all_set = np.tile(_by_pixel(odds).sum(axis=2), odds.shape[2] // STEPS_X)
    return _ends(-odds, unset) + all_set


def _by_pixel(values: Array) -> Array:
    return values.reshape(*values.shape[:2], -1, STEPS_X)


def _caps(unset: Array, y_step: int, lines_apart: int) -> tuple[Array, Array]:
    """(2, V, `STEPS_X`) log likelihood of all rows above one, and of all below; of a field every other is
    interpolated, or missing.
    """
    of_rows = _by_pixel(unset).sum(axis=2).reshape(2, -1, STEPS_Y, STEPS_X)
    if lines_apart == 1:
        of_rows[1] = of_rows[0]
    of_rows[1] *= y_step == 1
    odd = np.arange(of_rows.shape[1]) % 2 == 1
    mixed = np.where(odd[:, np.newaxis, np.newaxis], of_rows[::-1], of_rows)
    until = np.cumsum(mixed, axis=1)
    both = until - mixed, until[:, -1:] - until
    shape = 2, unset.shape[1], STEPS_X
    above, below = (np.where(odd[:, np.newaxis, np.newaxis], one[::-1], one).reshape(shape) for one in both)
    return above, below


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


def is_delivered(packed: PackedField, row: NDArray[np.int64]) -> Mask:
    """True for rows that the camera delivered; the others of a doubled field are interpolated."""
    return (row & 1) == packed.parity if packed.is_doubled else row >= 0


def sizes_of(moments: Moments, counted: Mask, centres: Array, packed: PackedField) -> Sizes:
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
    pixels: NDArray[np.int64], delivered: Moments, sizes: Sizes, counted: Mask, spread_px: float
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
