"""Runs of set pixels, found in packed bits without unpacking them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ONE, LAST_BIT = np.uint64(1), np.uint64(63)
WORD_BYTES, BIG_ENDIAN = 8, np.dtype(">u8")


class Runs(NamedTuple):
    """R runs of neighbouring set pixels in one row each, ordered by row, then column.

    Attributes:
        row: (R,) int64.
        first: (R,) int64, column of the first pixel; `last`: of the last one.
    """

    row: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    def taken(self, order: NDArray[np.intp]) -> "Runs":
        """These of them, in this order."""
        return Runs(self.row[order], self.first[order], self.last[order])


def find_runs(bits: NDArray[np.uint8]) -> Runs:
    """The runs of a packed bit picture.

    A run begins and ends where neighbouring pixels differ, by turns; only bytes in which some do are looked
    at: in a field of targets, one in twenty.

    Args:
        bits: (rows, bytes) uint8, C-contiguous, eight pixels a byte with the leftmost in its highest bit;
            bits beyond the last column are zero.
    """
    words = _words(bits)
    edges = _edges(words).astype(BIG_ENDIAN).view(np.uint8)
    place = (edges != 0).nonzero()[0]
    position = np.unpackbits(edges[place]).view(np.bool_).nonzero()[0]
    pixel = (place[position >> 3] << 3) + (position & 7)
    first, end = pixel[::2], pixel[1::2]
    width = words.shape[1] * WORD_BYTES * 8
    row = first // width
    begin = row * width
    return Runs(row, first - begin, end - begin - 1)


def _words(bits: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """(rows, words): 64 pixels each, the leftmost in the highest bit; at least one pixel a row is empty."""
    rows, stride = bits.shape
    padded = np.zeros((rows, (stride // WORD_BYTES + 1) * WORD_BYTES), np.uint8)
    padded[:, :stride] = bits
    return padded.view(BIG_ENDIAN).astype(np.uint64)


def _edges(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """(words,) the pixels that differ from the one before, of all rows one after the other."""
    flat = words.ravel()
    edges = flat ^ (flat >> ONE)
    edges[1:] ^= flat[:-1] << LAST_BIT
    return edges
