"""Fields as a driver delivers them; both sides import this."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def in_buffers(luma: NDArray[np.uint8], parities: Sequence[int]) -> list[NDArray[np.uint8]]:
    """Each field of (N, rows, columns) as a view into a driver's buffer of its own: YUYV, woven."""
    count, rows, columns = luma.shape
    buffers = np.full((count, 2 * rows, 2 * columns), 128, np.uint8)
    views = [buffer[parity::2, ::2] for buffer, parity in zip(buffers, parities, strict=True)]
    for view, lines in zip(views, luma, strict=True):
        view[:] = lines
    return views
