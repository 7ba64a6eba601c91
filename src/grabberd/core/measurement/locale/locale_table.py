"""Tables of log likelihoods over a target's positions, to be summed over the runs of a blob.

Given the position, the bits of a blob are independent, so the log likelihood of a position is a sum over
pixels: one constant for an empty picture, and for each run the log odds of its pixels. These are cumulated
along the rows, so that a run needs only its two ends. Positions form a fine grid through the whole picture,
so a table depends only on where an end is relative to the target.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from grabberd.core.measurement.locale.locale_model import Appearance, log_odds

Array = NDArray[np.float64]
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
        entry: Whole = ((2 * part + interpolated) * self.columns + column) * self.rows + row
        return entry

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
    cumulated: Array = (left + of_unset.sum(axis=2, keepdims=True)).reshape(odds.shape)
    return cumulated


def _starts(odds: Array, unset: Array) -> Array:
    """Likewise given its start; that pixel and those to its right are set."""
    all_set = np.tile(_by_pixel(odds).sum(axis=2), odds.shape[2] // STEPS_X)
    cumulated: Array = _ends(-odds, unset) + all_set
    return cumulated


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
