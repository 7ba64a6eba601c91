"""Appearance of a target at 1 bit, and tables of log likelihoods over its positions, summed over runs.

A disc is a stack of chords, blurred by a Gaussian and by the pixels that collect the light; all lengths are
in frame pixels, light is in units of the contrast. Given the position, bits are independent: the log
likelihood is one constant for an empty picture and, for each run, the log odds of its pixels. These are
cumulated along the rows, so that a run needs only its two ends. Positions form a fine grid through the whole
picture, so a table depends only on where an end is relative to the target.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
