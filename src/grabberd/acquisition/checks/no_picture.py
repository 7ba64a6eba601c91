"""Whether a field shows what a grabber makes up while no camera is at its input: blue, black, bars or snow.

What a chip draws has no noise, so its rows are alike to the bit, or each of one grey value. Snow has nothing
but noise. A dark camera has noise of its own and some contrast less than snow: that is a picture.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

FLAT = "no signal: a flat picture"
BARS = "no signal: bars"
SNOW = "no signal: snow"

_EDGE_ROWS = 4
"""Rows at the top and at the bottom that a chip may blank."""
_SNOW_SIGMA = 25.0
_SNOW_CORRELATION = 0.1
_SNOW_EVERY_ROW = _FEW = 16


def no_picture(rows: NDArray[np.uint8], hashes: NDArray[np.uint64]) -> str | None:
    """`FLAT`, `BARS`, `SNOW`, or None for a picture.

    Args:
        rows: (rows, columns) grey values of one field.
        hashes: (rows,) equal where rows are equal.
    """
    return _drawn(rows, hashes) or _snow(rows)


def _drawn(rows: NDArray[np.uint8], hashes: NDArray[np.uint64]) -> str | None:
    if len(rows) <= 2 * _EDGE_ROWS:
        return None
    inner, hashes = rows[_EDGE_ROWS:-_EDGE_ROWS], hashes[_EDGE_ROWS:-_EDGE_ROWS]
    if (hashes == hashes[0]).all():
        return FLAT if _is_even(inner[:1]) else BARS
    return BARS if _is_even(inner[::_FEW]) and _is_even(inner) else None


def _is_even(rows: NDArray[np.uint8]) -> bool:
    """Whether each row is of one grey value."""
    return bool((rows == rows[:, :1]).all())


def _snow(rows: NDArray[np.uint8]) -> str | None:
    """Strong contrast that no row shares with the next."""
    lower = rows[_SNOW_EVERY_ROW::_SNOW_EVERY_ROW]
    if not lower.size or cv2.meanStdDev(lower)[1].item() < _SNOW_SIGMA:
        return None
    upper = rows[_SNOW_EVERY_ROW - 1 : -1 : _SNOW_EVERY_ROW]
    with np.errstate(invalid="ignore"):  # a flat sample is not correlated with anything, and no snow
        correlation = np.corrcoef(upper.ravel(), lower.ravel())[0, 1]
    return SNOW if correlation < _SNOW_CORRELATION else None
