"""Log likelihoods of every place of a target, to be summed over the runs that are seen of it.

The bits of a blob are independent of each other but for its place, so the log likelihood of a place is a sum
over pixels: one constant for an empty window, and for each run the log odds of its pixels. These are
cumulated along the rows, so that a run needs only its two ends: one product of matrices for all blobs.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_model import Appearance, Odds, log_odds

Single = NDArray[np.float32]
Whole = NDArray[np.int64]

STEPS_X = 10
"""Places looked at in a pixel of x; `STEPS_Y`: in a frame line of y."""
STEPS_Y = 8
REACH_X_PX = 0.8
"""Places are looked at so far from the anchor, the pixel nearest to the centroid."""
REACH_Y_PX = {1: 0.875, 2: 1.5}


TABLES = 512
"""So many are kept, of some 100 kB each."""


class Window(NamedTuple):
    """How many columns and rows about the anchor are looked at, on either side."""

    columns: int
    rows: int

    @classmethod
    def of(cls, half_width_px: float, half_height_px: float, y_step: int) -> "Window":
        """Large enough for a blob of these half axes wherever its anchor."""
        columns = half_width_px + REACH_X_PX + 1.0
        return cls(math.ceil(columns), math.ceil((half_height_px + REACH_Y_PX[y_step] + 1.0) / y_step))

    @property
    def ends(self) -> int:
        """Columns of a row's cumulated log odds."""
        return 2 * self.columns + 2

    @property
    def size(self) -> int:
        """Ends of all rows."""
        return (2 * self.rows + 1) * self.ends


class Table(NamedTuple):
    """Log likelihoods of G places.

    Attributes:
        empty: (G,) of a window without any set pixel.
        cumulated: (`Window.size`, G) log odds from the row's start to each end.
    """

    empty: Single
    cumulated: Single


class Axes(NamedTuple):
    """Where places are looked at relative to the anchor, frame pixels: the first runs through x."""

    x_px: NDArray[np.float64]
    y_px: NDArray[np.float64]


@lru_cache(maxsize=4)
def axes(y_step: int) -> Axes:
    """All places are the pairs of these, row by row."""
    return Axes(_axis(REACH_X_PX, STEPS_X) / STEPS_X, _axis(REACH_Y_PX[y_step], STEPS_Y) / STEPS_Y)


def _axis(reach_px: float, steps: int) -> Whole:
    whole = math.floor(reach_px * steps)
    return np.arange(-whole, whole + 1)


@lru_cache(maxsize=TABLES)
def table(seen: Appearance, window: Window, interpolated: bool) -> Table:
    """The table of an appearance, kept for the next field; arguments as of `built`."""
    return built(seen, window, interpolated)


def built(seen: Appearance, window: Window, interpolated: bool) -> Table:
    """The table of an appearance.

    Args:
        seen: what the targets look like.
        window: of the pixels that are looked at.
        interpolated: whether the anchor's own row is an interpolated one.
    """
    x, y = _axis(REACH_X_PX, STEPS_X), _axis(REACH_Y_PX[seen.y_step], STEPS_Y)
    column = np.arange(-window.columns, window.columns + 1) * STEPS_X
    row = np.arange(-window.rows, window.rows + 1) * (STEPS_Y * seen.y_step)
    u, v = _span(column, x), _span(row, y)
    odds = log_odds(seen, u / STEPS_X, v / STEPS_Y)
    at_u = (column[:, np.newaxis] - x) - u[0]
    at_v = (row[:, np.newaxis] - y) - v[0]
    delivered = np.arange(-window.rows, window.rows + 1) % 2 == int(interpolated)
    return _gathered(odds, delivered | (seen.y_step == 2), at_u, at_v)


def _span(pixel: Whole, place: Whole) -> Whole:
    return np.arange(pixel[0] - place[-1], pixel[-1] - place[0] + 1)


def _gathered(odds: Odds, real: NDArray[np.bool_], at_u: Whole, at_v: Whole) -> Table:
    """The odds of each of the window's pixels at each place; `real`: which of its rows were delivered."""
    of_rows = np.where(real[:, np.newaxis, np.newaxis], odds.delivered[at_v], odds.interpolated[at_v])
    pixels = of_rows.astype(np.float32)[:, :, at_u].transpose(0, 2, 1, 3)
    rows, columns, count = pixels.shape[0], pixels.shape[1], pixels.shape[2] * pixels.shape[3]
    cumulated = np.zeros((rows, columns + 1, count), np.float32)
    np.cumsum(pixels.reshape(rows, columns, count), axis=1, out=cumulated[:, 1:])
    unset = -np.log1p(np.exp(of_rows))
    empty = unset[:, :, at_u].sum(axis=(0, 2), dtype=np.float64)
    return Table(empty.ravel().astype(np.float32), cumulated.reshape(-1, count))
