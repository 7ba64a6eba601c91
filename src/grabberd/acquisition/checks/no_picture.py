"""Recognition of the picture a grabber substitutes while no camera is connected: blue, black, bars or snow.

A picture drawn by a chip has no noise: its rows are identical bit for bit, or each row has a single grey
value. Snow is nothing but noise. A dark camera has noise of its own, with less contrast than snow, and counts
as a picture.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

FLAT = "no signal: a flat picture"
BARS = "no signal: bars"
SNOW = "no signal: snow"

_EDGE_ROWS = 4
"""Rows at the top and bottom that a chip may blank."""
_SNOW_SIGMA = 25.0
"""Grey values; a dark camera stays well below."""
_SNOW_CORRELATION = 0.1
_SNOW_EVERY_ROW = _FEW = 16
"""Sampling of rows: a sixteenth of the picture decides, so that a normal field costs next to nothing."""


def no_picture(rows: NDArray[np.uint8], hashes: NDArray[np.uint64]) -> str | None:
    """Return `FLAT`, `BARS` or `SNOW`, or None for a real picture.

    Args:
        rows: (rows, columns) grey values of one field.
        hashes: (rows,) numbers that are equal where rows are equal.
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
    """True if every row has a single grey value."""
    return bool((rows == rows[:, :1]).all())


def _snow(rows: NDArray[np.uint8]) -> str | None:
    """Detect strong contrast that is uncorrelated from row to row."""
    lower = rows[_SNOW_EVERY_ROW::_SNOW_EVERY_ROW]
    if not lower.size or cv2.meanStdDev(lower)[1].item() < _SNOW_SIGMA:
        return None
    upper = rows[_SNOW_EVERY_ROW - 1 : -1 : _SNOW_EVERY_ROW]
    with np.errstate(invalid="ignore"):  # a flat sample has no correlation (NaN) and is not snow
        correlation = np.corrcoef(upper.ravel(), lower.ravel())[0, 1]
    return SNOW if correlation < _SNOW_CORRELATION else None
