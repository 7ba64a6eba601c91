"""Log likelihoods of every place of a target, to be summed over the runs that are seen of it.

The bits of a blob are independent of each other but for its place, so the log likelihood of a place is a sum
over pixels: one constant for an empty picture, and for each run the log odds of its pixels. These are
cumulated along the rows, so that a run needs only its two ends. Places are those of a fine grid through the
whole picture, so a table depends on nothing but where an end is relative to the target.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from grabberd.measurement.locale_model import Appearance, log_odds

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Whole = NDArray[np.int64]

STEPS_X = 10
"""Places looked at in a pixel of x; `STEPS_Y`: in a frame line of y."""
STEPS_Y = 8
REACH_X = 4
"""Places are looked at so many steps either side of the centroid; by `y_step`, `REACH_Y` likewise."""
REACH_Y = {1: 4, 2: 6}
BEYOND_PX = 4
"""A table reaches so far beyond the half axes: pixels further away are not looked at."""
TABLES = 128
"""So many are kept, of some 100 kB each."""


class Offsets(NamedTuple):
    """The G places that are looked at, relative to the middle one, frame pixels: (G,) each, x by x."""

    x_px: Single
    y_px: Single


@lru_cache(maxsize=2)
def offsets(y_step: int) -> Offsets:
    """In the order of the windows of a `Table`: from the right and from below."""
    x, y = np.mgrid[-REACH_X : REACH_X + 1, -REACH_Y[y_step] : REACH_Y[y_step] + 1].reshape(2, -1)
    return Offsets((-x / STEPS_X).astype(np.float32), (-y / STEPS_Y).astype(np.float32))


class Table(NamedTuple):
    """Log likelihoods of w · h places about a middle one, as windows into fine grids.

    Everything is asked for by the steps from the middle to a run's start or end, and by those to its row; the
    first index is 1 for an interpolated row. The half of a row that lies to the left of a target is decided
    by the run's start, the other by its end.

    Attributes:
        starts: (2, U, V, w, h) float32, of a row's left half; `ends`: of its right half.
        above: (2, `STEPS_X`, V, w, h) of all rows above an upmost one, which are empty, by the steps to any
            pixel; `below`: of those below.
        origin: (2,) x, y: which steps are at the place 0.
    """

    starts: Single
    ends: Single
    above: Single
    below: Single
    origin: tuple[int, int]


class Extent(NamedTuple):
    """How far tables reach from the middle, columns and frame lines."""

    columns: int
    lines: int

    @classmethod
    def around(cls, half_width_px: float, half_height_px: float) -> "Extent":
        """Enough for targets of these half axes."""
        return cls(math.ceil(half_width_px) + BEYOND_PX, math.ceil(half_height_px) + BEYOND_PX)


@lru_cache(maxsize=TABLES)
def table(seen: Appearance, extent: Extent) -> Table:
    """The table of an appearance, kept for the next field."""
    columns, lines = extent
    u = np.arange(-columns * STEPS_X, columns * STEPS_X)
    v = np.arange(-lines * STEPS_Y, lines * STEPS_Y)
    odds = np.stack(log_odds(seen, u / STEPS_X, v / STEPS_Y))
    unset = -np.log1p(np.exp(odds))
    right = (u / STEPS_X + 0.5).clip(0.0, 1.0)
    size = 2 * REACH_X + 1, 2 * REACH_Y[seen.y_step] + 1
    starts = _starts(odds * (1.0 - right), unset * (1.0 - right))
    ends = _ends(odds * right, unset * right)
    above, below = (
        np.pad(one, ((0, 0), (0, 0), (0, size[0] - 1)), mode="wrap") for one in _caps(unset, seen.y_step)
    )
    return Table(
        starts=_windows(starts, size),
        ends=_windows(ends, size),
        above=_windows(above, size),
        below=_windows(below, size),
        origin=(int(u[0]) + REACH_X, int(v[0]) + REACH_Y[seen.y_step]),
    )


def _windows(values: Array, size: tuple[int, int]) -> Single:
    """Of values (2, V, U), columns first: windows are higher than wide, and long pieces are fast to take."""
    turned = np.ascontiguousarray(values.swapaxes(1, 2), np.float32)
    windows: Single = sliding_window_view(turned, size, axis=(1, 2))
    return windows


def _ends(odds: Array, unset: Array) -> Array:
    """(2, V, U) of all pixels of a row that lie whole pixels from a run's end; those to the left are set."""
    of_pixels, of_unset = _by_pixel(odds), _by_pixel(unset)
    left = np.cumsum(of_pixels, axis=2) - of_pixels
    found: Array = (left + of_unset.sum(axis=2, keepdims=True)).reshape(odds.shape)
    return found


def _starts(odds: Array, unset: Array) -> Array:
    """Likewise of its start; those to the right, and that at the start, are set."""
    all_set = np.tile(_by_pixel(odds).sum(axis=2), odds.shape[2] // STEPS_X)
    found: Array = _ends(-odds, unset) + all_set
    return found


def _by_pixel(values: Array) -> Array:
    return values.reshape(*values.shape[:2], -1, STEPS_X)


def _caps(unset: Array, y_step: int) -> tuple[Array, Array]:
    """(2, V, `STEPS_X`) of all rows above one, and of all below; interpolated ones are every other."""
    of_rows = _by_pixel(unset).sum(axis=2).reshape(2, -1, STEPS_Y, STEPS_X)
    of_rows[1] *= y_step == 1
    odd = np.arange(of_rows.shape[1]) % 2 == 1
    mixed = np.where(odd[:, np.newaxis, np.newaxis], of_rows[::-1], of_rows)
    until = np.cumsum(mixed, axis=1)
    both = until - mixed, until[:, -1:] - until
    shape = 2, unset.shape[1], STEPS_X
    above, below = (np.where(odd[:, np.newaxis, np.newaxis], one[::-1], one).reshape(shape) for one in both)
    return above, below
