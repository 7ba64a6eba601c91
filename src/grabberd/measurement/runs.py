"""Runs of set pixels, found in packed bits without unpacking them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ONE, SEVEN = np.uint8(1), np.uint8(7)


class Runs(NamedTuple):
    """R runs of neighbouring set pixels in one row each, ordered by row, then column.

    Attributes:
        row: (R,) int64.
        first: (R,) int64, column of the first pixel; `last`: of the last one.
    """

    row: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]


def find_runs(bits: NDArray[np.uint8]) -> Runs:
    """The runs of a packed bit picture.

    Only bytes that are not zero are looked at: in a field of targets, one in twenty-five.

    Args:
        bits: (rows, bytes) uint8, C-contiguous, eight pixels a byte with the leftmost in its highest bit;
            bits beyond the last column are zero.
    """
    stride = bits.shape[1]
    flat = bits.ravel()
    place = np.flatnonzero(flat != 0)
    row = place // stride
    byte = place - row * stride
    value = flat[place]
    before = _neighbours(flat, place - 1, byte > 0)
    after = _neighbours(flat, place + 1, byte < stride - 1)
    starts = value & ~(value >> ONE | before << SEVEN)
    ends = value & ~(value << ONE | after >> SEVEN)
    at_start, first = _set_bits(starts, byte)
    _, last = _set_bits(ends, byte)
    return Runs(row[at_start], first, last)


def _neighbours(
    flat: NDArray[np.uint8], place: NDArray[np.int64], inside: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """The neighbouring bytes, zero where the row has none."""
    neighbours: NDArray[np.uint8] = flat.take(place, mode="clip") * inside
    return neighbours


def _set_bits(
    values: NDArray[np.uint8], byte: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of every set bit: the index of its value, and its column."""
    position = np.flatnonzero(np.unpackbits(values).view(np.bool_))
    index = position >> 3
    return index, (byte[index] << 3) + (position & 7)
