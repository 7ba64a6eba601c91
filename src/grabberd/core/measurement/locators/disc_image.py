"""Image of a disc in space, and its derivatives: an ellipse blurred by the spread function.

Along the normal of its edge an ellipse falls off like the integral of the spread function, whose width
differs along and across the lines. That is exact for a straight edge; the effect of curvature is symmetrical
and so does not affect the position.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

X, Y, CONTRAST, BACKGROUND, HALF_WIDTH, HALF_HEIGHT, LEAN, BLURRING = range(8)
"""Parameters of a disc's image: centre, grey values, half axes, columns per line by which its chords lean,
and the variance of the spread function across the lines, which a camera's rows enlarge."""
PER_SIGMA = 512
"""Table entries per σ of the edge."""
REACH = 5.0
"""σ either side of the edge that the table covers."""

Array = NDArray[np.float32]


def disc_images(discs: Array, x_px: Array, y_px: Array, blurring_x: float) -> tuple[Array, Array]:
    """Compute the grey values of N discs and their derivatives.

    Args:
        discs: (8, N), in the order of the constants above.
        x_px: (w,) columns, from the same origin as the centres.
        y_px: (h,) frame lines, likewise.
        blurring_x: Variance of the spread function along the lines, pixels included.

    Returns:
        (N, h, w) grey values, and (N, 8, h, w) derivatives by the eight parameters.
    """
    x, y, contrast, background, half_width, half_height, lean, blurring_y = discs[:, :, np.newaxis]
    narrow, low = 1 / half_width, 1 / half_height
    v = np.repeat(y_px, len(x_px)) - y
    u = (np.tile(x_px, len(y_px)) - x - lean * v) * narrow
    down = v * low
    radius2 = u * u + down * down + np.float32(1e-6)
    across, along = u * narrow, down * low - lean * u * narrow
    along2 = along * along
    sharp = 1 / np.sqrt(np.float32(blurring_x) * (across * across) + blurring_y * along2 + np.float32(1e-6))
    distance = (radius2 - np.sqrt(radius2)) * sharp
    inside, density = _looked_up(distance)
    slopes = np.empty((discs.shape[1], 8, v.shape[1]), np.float32)
    edge = contrast * density * sharp
    slopes[:, X], slopes[:, Y] = edge * across, edge * along
    slopes[:, CONTRAST], slopes[:, BACKGROUND] = inside, 1.0
    slopes[:, HALF_WIDTH], slopes[:, HALF_HEIGHT] = edge * u * across, edge * down * down * low
    slopes[:, LEAN] = slopes[:, X] * v
    slopes[:, BLURRING] = np.float32(0.5) * edge * sharp * distance * along2
    shape = len(y_px), len(x_px)
    return (background + contrast * inside).reshape(-1, *shape), slopes.reshape(-1, 8, *shape)


def _looked_up(distance: Array) -> tuple[Array, Array]:
    """Look up an edge's profile and its slope at distances in σ.

    Both are continued by their slopes between entries: otherwise rounding would decide between two entries.
    """
    profile, slope = edge_table()
    place = (distance + np.float32(REACH)) * np.float32(PER_SIGMA) + np.float32(0.5)
    place = place.clip(0, len(profile) - 1)
    entry = place.astype(np.intp)
    beyond = (place - entry.astype(np.float32) - np.float32(0.5)) * np.float32(1 / PER_SIGMA)
    z = entry.astype(np.float32) * np.float32(1 / PER_SIGMA) - np.float32(REACH)
    density = slope.take(entry, mode="clip")
    inside = profile.take(entry, mode="clip") - density * beyond * (1 - np.float32(0.5) * z * beyond)
    return inside, density * (1 - z * beyond)


@cache
def edge_table() -> tuple[Array, Array]:
    """Profile of an edge and its slope, `PER_SIGMA` entries per σ from −REACH on."""
    z = np.arange(-REACH, REACH, 1 / PER_SIGMA)
    density = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
    inside = 1.0 - np.cumsum(density) / density.sum()
    return inside.astype(np.float32), density.astype(np.float32)
