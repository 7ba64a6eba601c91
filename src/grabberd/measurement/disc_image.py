"""The picture of a disc in space, and its derivatives: an ellipse blurred by the spread function.

Along the normal of its edge an ellipse falls off like the integral of the spread function, which reaches
differently far along and across the lines. That is exact for a straight edge; what the curvature adds is
symmetrical, and so takes no part in the place.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

X, Y, CONTRAST, BACKGROUND, HALF_WIDTH, HALF_HEIGHT, LEAN = range(7)
"""What describes a disc's picture: centre, grey values, half axes, and columns a line that chords move."""
PER_SIGMA = 512
REACH = 5.0

Array = NDArray[np.float32]


class Spread(NamedTuple):
    """Variances of the spread function: `x` along the lines, `y` across, pixels and rows included."""

    x: float
    y: float

    @classmethod
    def of(cls, spread_px: float, row_px: float) -> "Spread":
        """Of lens and video alike in x and y, a pixel of one column, and a row of so many frame lines."""
        return cls(spread_px**2 + 1 / 12, spread_px**2 + row_px**2 / 12)


def disc_images(discs: Array, x_px: Array, y_px: Array, spread: Spread) -> tuple[Array, Array]:
    """Grey values of N discs and their derivatives.

    Args:
        discs: (7, N), in the order of the constants above.
        x_px: (w,) columns; `y_px`: (h,) frame lines, on the same origin as the centres.
        spread: of the edges.

    Returns:
        (N, h, w) grey values, (N, 7, h, w) derivatives by the seven.
    """
    x, y, contrast, background, half_width, half_height, lean = discs[:, :, np.newaxis, np.newaxis]
    v = y_px[:, np.newaxis] - y
    u = (x_px - x - lean * v) / half_width
    down = v / half_height
    radius2 = u * u + down * down + np.float32(1e-6)
    radius = np.sqrt(radius2)
    across, along = u / half_width, down / half_height - lean * u / half_width
    across2, along2 = across * across, along * along
    steep2 = across2 + along2 + np.float32(1e-6)
    blurring = np.float32(spread.x) * across2 + np.float32(spread.y) * along2 + np.float32(1e-6)
    distance = (radius2 - radius) / np.sqrt(blurring)
    inside, density = _looked_up(distance)
    slopes = np.empty((discs.shape[1], 7, len(y_px), len(x_px)), np.float32)
    edge = contrast * density / np.sqrt(blurring)
    slopes[:, X], slopes[:, Y] = edge * across, edge * along
    slopes[:, CONTRAST], slopes[:, BACKGROUND] = inside, 1.0
    slopes[:, HALF_WIDTH], slopes[:, HALF_HEIGHT] = (
        edge * u * u / half_width,
        edge * down * down / half_height,
    )
    slopes[:, LEAN] = slopes[:, X] * v
    return background + contrast * inside, slopes


def _looked_up(distance: Array) -> tuple[Array, Array]:
    """How much of an edge so many σ away is there, and how fast that changes."""
    place = ((distance + np.float32(REACH)) * np.float32(PER_SIGMA) + np.float32(0.5)).astype(np.intp)
    inside, density = _table()
    return inside.take(place, mode="clip"), density.take(place, mode="clip")


@cache
def _table() -> tuple[Array, Array]:
    z = np.arange(-REACH, REACH, 1 / PER_SIGMA)
    density = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
    inside = 1.0 - np.cumsum(density) / density.sum()
    return inside.astype(np.float32), density.astype(np.float32)
