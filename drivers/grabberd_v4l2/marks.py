"""Marks in a buffer before the kernel fills it: where one is left afterwards, nothing was written.

Drivers leave out what was lost on its way. There the buffer shows what was in it before, of a field half a
second ago, without a word. Three marks in each line find every gap of more than a third of one.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field
from grabberd_v4l2.fields import Granted
from grabberd_v4l2.formats import FORMATS, bytes_per_pixel

_MARK = np.uint64(int.from_bytes(bytes((3, 11, 6, 14, 1, 9, 4, 12)), sys.byteorder))
"""Darker than black (16), and of no colour: no picture has it, and where it stays it is no target."""
_A_LINE = 3
_WORD = 8


class Marks:
    """Marks in the buffers of one stream.

    Args:
        granted: The stream; its format must not be compressed.
    """

    def __init__(self, granted: Granted) -> None:
        self._bytes_per_line = granted.bytes_per_line
        part_bytes = granted.columns * bytes_per_pixel(granted.fourcc) // _A_LINE
        self._step_bytes = part_bytes // _WORD * _WORD
        self._shape = (granted.lines, _A_LINE)
        # What a driver never writes, as half a line, is no gap, but for the first buffer.
        self._known: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, granted: Granted) -> "Marks | None":
        """Marks for a stream; None if its buffers cannot have any."""
        if FORMATS[granted.fourcc].is_compressed or granted.bytes_per_line % _WORD:
            return None
        has_room = granted.columns * bytes_per_pixel(granted.fourcc) >= _A_LINE * _WORD
        return cls(granted) if has_room else None

    def put(self, buffer: NDArray[np.uint8]) -> None:
        """Marks a buffer, (bytes,), that the kernel is about to fill."""
        self._places(buffer)[:] = _MARK

    def gaps(self, buffer: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """(lines,) true for lines of a filled buffer of which a part was not written, but has been before."""
        is_left = self._places(buffer) == _MARK
        known, self._known = self._known, ~is_left if self._known is None else self._known | ~is_left
        found: NDArray[np.bool_] = (is_left if known is None else is_left & known).any(axis=1)
        return found

    def _places(self, buffer: NDArray[np.uint8]) -> NDArray[np.uint64]:
        strides = (self._bytes_per_line, self._step_bytes)
        return np.ndarray(self._shape, np.uint64, buffer, strides=strides)


def stale(field: Field, gaps: NDArray[np.bool_]) -> str | None:
    """The damage of a field whose rows (rows,) have gaps; None if none has."""
    rows = np.flatnonzero(gaps)
    if not rows.size:
        return None
    first, last = (field.y0 + int(row) * field.y_step for row in (rows[0], rows[-1]))
    end = "" if rows[-1] == field.rows - 1 else f" to line {last}"
    return f"stale from line {first}{end}"
