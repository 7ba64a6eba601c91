"""Sharpness of the targets' edges in a grey field, to focus a lens by."""

import math

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field

IDEAL = 2 / 3
"""Sum of the squared steps of an edge that only the pixels blur, the mean over its places in a pixel."""
MARGIN_PX = 4.0
"""Distance from a target's edge within which its blur lies."""
OUTSIDE_PX = 3
"""Columns beyond that show the background."""
LEAST_CONTRAST = 25.0
"""Grey values between target and background below which noise decides."""
LEAST_TARGETS = 5
MEDIAN_SQUARE = 0.455
"""Median of the square of a normal variable of variance 1."""


def edge_sharpness(
    field: Field, xy_px: NDArray[np.float64], diameter_px: float, white_level: int
) -> float | None:
    """Sharpness of the edges of bright targets along the lines: 1 where they are as sharp as pixels can be.

    An edge rises from background to target by steps from pixel to pixel, which as shares of the whole rise
    sum up to 1. The sum of their squares is 2/3 for an edge that lies within a pixel or two, 1 / n for one
    that takes n pixels, whatever the brightness of target and background. The expected share of the noise is
    taken off. Only steps along a line are used: lines of a field are two frame lines apart, and jitter
    against each other.
    A target that is as bright as the camera gets has lost the top of its edge, and is left out.

    Args:
        field: Field of 8 bits with its original lines.
        xy_px: (N, 2) centroids of the targets in frame pixels.
        diameter_px: Their mean diameter.
        white_level: Grey value from which a pixel may be clipped.

    Returns:
        The median over the targets; None if fewer than five are to be judged.
    """
    inner = math.ceil(diameter_px / 2 + MARGIN_PX)
    lines = _lines(field, xy_px, inner + OUTSIDE_PX)
    if len(lines) < LEAST_TARGETS:
        return None
    outer = np.concatenate([lines[:, :OUTSIDE_PX], lines[:, -OUTSIDE_PX:]], axis=1)
    background, brightest = np.median(outer, axis=1), lines.max(axis=1)
    contrast = brightest - background
    kept = (contrast >= LEAST_CONTRAST) & (brightest < white_level)
    if np.count_nonzero(kept) < LEAST_TARGETS:
        return None
    steps = np.diff(lines[kept], axis=1)
    noise = np.median(np.diff(lines[kept][:, :OUTSIDE_PX], axis=1) ** 2) / MEDIAN_SQUARE
    squares = (steps[:, OUTSIDE_PX - 1 : -(OUTSIDE_PX - 1)] ** 2 - noise).sum(axis=1)
    shares = squares / (2 * contrast[kept] ** 2)
    return float(np.clip(np.median(shares) / IDEAL, 0.0, 1.0))


def _lines(field: Field, xy_px: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """(M, 2 reach + 1) grey values of the row through the middle of each target that is far enough inside."""
    columns = np.rint(xy_px[:, 0]).astype(np.intp)
    rows = np.rint((xy_px[:, 1] - field.y0) / field.y_step).astype(np.intp)
    inside = (columns >= reach) & (columns < field.columns - reach) & (rows >= 0) & (rows < field.rows)
    along = np.arange(-reach, reach + 1)
    lines: NDArray[np.float64] = field.luma[rows[inside, None], columns[inside, None] + along].astype(
        np.float64
    )
    return lines
