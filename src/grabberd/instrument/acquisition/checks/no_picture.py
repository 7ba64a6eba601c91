"""Pictures that a grabber's chip draws in place of the camera's.

They have no noise: their rows are identical bit for bit, or each row has a single grey value. Snow is nothing
but noise. A dark camera has noise of its own, with less contrast than snow, and counts as a picture.
"""

import math

import numpy as np
from numpy.typing import NDArray

FLAT = "no signal: a flat picture"
BARS = "no signal: bars"
SNOW = "no signal: snow"
KINDS = (None, FLAT, BARS, SNOW)
"""By the number that the kernel gives them."""
_EDGE_ROWS = 4
"""Rows at the top and bottom that a chip may blank."""
_SNOW_SIGMA = 25
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
    lower = rows[_SNOW_EVERY_ROW::_SNOW_EVERY_ROW].ravel().astype(np.float64)
    count, total = len(lower), int(lower.sum())
    # Whole numbers, so that the order of the sums is of no importance.
    variance = count * int(lower @ lower) - total**2
    if not count or variance < (_SNOW_SIGMA * count) ** 2:
        return None
    upper = rows[_SNOW_EVERY_ROW - 1 : -1 : _SNOW_EVERY_ROW].ravel().astype(np.float64)
    upper_total = int(upper.sum())
    upper_variance = count * int(upper @ upper) - upper_total**2
    covariance = count * int(upper @ lower) - upper_total * total
    return (
        SNOW if covariance < _SNOW_CORRELATION * math.sqrt(float(variance) * float(upper_variance)) else None
    )
