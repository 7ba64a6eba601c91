"""Field number and parity in the top left corner of a picture, for tests of order and loss.

Forty cells of 4 columns by 8 field rows, white for 1: a 1 and a 0 as marker, 32 bits of the field number with
the highest first, the parity, and five bits of check sum.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_CELL, ROWS, _BITS = 4, 8, 40
_SUM_BITS = 5
COLUMNS = _CELL * _BITS
"""Columns of the stamp, from the left; `ROWS` from the top."""


class Stamp(NamedTuple):
    """Content of a stamp."""

    number: int
    parity: int


def write_stamp(luma: NDArray[np.uint8], stamp: Stamp) -> None:
    """Writes into luma (rows, columns), in place; the number modulo 2³²."""
    number = stamp.number % 2**32
    word = (0b10 << 33 | number << 1 | stamp.parity) << _SUM_BITS | _check_sum(number, stamp.parity)
    bits = np.unpackbits(np.frombuffer(word.to_bytes(_BITS // 8, "big"), np.uint8))
    luma[:ROWS, :COLUMNS] = np.repeat(bits * np.uint8(255), _CELL)


def read_stamp(luma: NDArray[np.uint8]) -> Stamp | None:
    """The stamp of a picture (rows, columns) uint8, or None if there is no legible one.

    The picture may be grey or thresholded, with intact or doubled lines.
    """
    # The middle of each cell only: resampling and doubled lines blur its edges.
    cells = luma[2 : ROWS - 2, :COLUMNS].reshape(-1, _BITS, _CELL)[:, :, 1:3].mean(axis=(0, 2))
    if cells[0] - cells[1] < 1:
        return None
    bits = cells > (cells[0] + cells[1]) / 2
    word = int.from_bytes(np.packbits(bits).tobytes(), "big")
    number, parity = word >> (_SUM_BITS + 1) & 0xFFFFFFFF, word >> _SUM_BITS & 1
    return Stamp(number, parity) if word & (2**_SUM_BITS - 1) == _check_sum(number, parity) else None


def _check_sum(number: int, parity: int) -> int:
    return (number * 2 + parity + 1) % 31
