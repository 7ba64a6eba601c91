"""Fields of grey values, and the split of an interlaced frame into two of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TOP = 0
"""Parity of the field with frame lines 0, 2, 4 …; for PAL the older one of a frame."""
BOTTOM = 1
"""Parity of the field with frame lines 1, 3, 5 …"""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Grey values of one field; row k is frame line `y0 + k * y_step`.

    Attributes:
        luma: (rows, columns) uint8. Often a view into a driver's buffer: copy it to keep it.
        parity: `TOP` or `BOTTOM`, of the field that the camera delivered.
        y0: Frame line of row 0.
        y_step: Frame lines from row to row: 2 if intact, 1 if the missing lines have been interpolated.
    """

    luma: NDArray[np.uint8]
    parity: int
    y0: int
    y_step: int

    @classmethod
    def intact(cls, luma: NDArray[np.uint8], parity: int) -> "Field":
        """Make a field of the lines of one parity as the camera delivered them; luma (rows, columns)
        uint8.
        """
        return cls(luma, parity, y0=parity, y_step=2)

    @property
    def rows(self) -> int:
        """Number of rows of `luma`."""
        return int(self.luma.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns of `luma`."""
        return int(self.luma.shape[1])


def split_frame(frame: NDArray[np.uint8], older: int = TOP) -> tuple[Field, Field]:
    """Split an interlaced frame into its two fields, the older first; views, not copies.

    Args:
        frame: (lines, columns) uint8 with an even number of lines.
        older: Parity that was exposed first: `TOP` for PAL, `BOTTOM` for some drivers.
    """
    first, second = (Field.intact(frame[parity::2], parity) for parity in (older, 1 - older))
    return first, second
