"""Labelling: from packed bits to connected components, their size, extent and centre (paper 3.5, eqs. 1, 2).

Packed planes are compared with the threshold, runs of set pixels found in the bits without unpacking them,
and touching runs joined to components; diagonal neighbours are connected.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.field import PackedField

ONE, LAST_BIT = np.uint64(1), np.uint64(63)
WORD_BYTES, BIG_ENDIAN = 8, np.dtype(">u8")


class Runs(NamedTuple):
    """R runs of adjacent set pixels, each in one row, ordered by row, then column.

    Attributes:
        row: (R,) int64, row of the run.
        first: (R,) int64, column of its first pixel.
        last: (R,) int64, column of its last pixel.
    """

    row: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    def taken(self, order: Indices) -> "Runs":
        """Select runs in the given order."""
        return Runs(self.row[order], self.first[order], self.last[order])


def find_runs(bits: NDArray[np.uint8]) -> Runs:
    """Find the runs of a packed bit picture.

    Runs begin and end, alternately, where adjacent pixels differ; only bytes containing such a place are
    unpacked: in a field of targets, one in twenty.

    Args:
        bits: (rows, bytes) uint8, C-contiguous, eight pixels per byte with the leftmost in the highest bit;
            bits beyond the last column are zero.
    """
    words = _words(bits)
    # Big-endian bytes keep the leftmost pixel first, the order of np.unpackbits.
    edges = _edges(words).astype(BIG_ENDIAN).view(np.uint8)
    byte = (edges != 0).nonzero()[0]
    position = np.unpackbits(edges[byte]).view(np.bool_).nonzero()[0]
    pixel = (byte[position >> 3] << 3) + (position & 7)
    first, end = pixel[::2], pixel[1::2]
    width = words.shape[1] * WORD_BYTES * 8
    row = first // width
    begin = row * width
    return Runs(row, first - begin, end - begin - 1)


def _words(bits: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """(rows, words) of 64 pixels, the leftmost in the highest bit; each row ends with an empty pixel."""
    rows, stride = bits.shape
    # An empty pixel behind every row ends its last run there, so runs never reach into the next row.
    padded = np.zeros((rows, (stride // WORD_BYTES + 1) * WORD_BYTES), np.uint8)
    padded[:, :stride] = bits
    return padded.view(BIG_ENDIAN).astype(np.uint64)


def _edges(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """(words,) marks of pixels that differ from the previous one, through all rows in sequence."""
    flat = words.ravel()
    edges = flat ^ (flat >> ONE)
    edges[1:] ^= flat[:-1] << LAST_BIT
    return edges


def target_bits(packed: PackedField) -> NDArray[np.uint8]:
    """Mark the pixels above the field's threshold.

    With 2 to 6 bits a pixel counts as the middle of its level, as in `unpack`, and the lowest level is always
    background. The planes are compared as they are, none is unpacked.

    Returns:
        (rows, ceil(columns / 8)) uint8, eight pixels per byte with the leftmost in the highest bit.
    """
    if packed.bits == 1:
        return _plane(packed.data)
    if packed.bits == 8:
        return np.packbits(_plane(packed.data) > packed.threshold, axis=1)
    return _planes_above(packed.data, _highest_background_level(packed))


def _plane(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return data[0]


def _highest_background_level(packed: PackedField) -> int:
    middle, step = 128 >> packed.bits, 256 >> packed.bits
    return max(0, (packed.threshold - middle) // step)


def _planes_above(planes: NDArray[np.uint8], level: int) -> NDArray[np.uint8]:
    """Mark where the number stored in the planes exceeds a level, comparing from the highest bit down."""
    above: NDArray[np.uint8] = np.zeros_like(planes[0])
    equal = np.full_like(above, 255)
    for weight, plane in zip(range(len(planes) - 1, -1, -1), planes, strict=True):
        if level >> weight & 1:
            equal &= plane
        else:
            above |= equal & plane
            equal &= ~plane
    return above


def run_greys(
    packed: PackedField, runs: Runs
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Gather the grey values of all pixels in the runs, one run after the other.

    Returns:
        (P,) int64 grey values as in `unpack`; (P,) int64 columns; (R,) int64 start index of each run.
    """
    length = runs.last - runs.first + 1
    begin = np.cumsum(length) - length
    stride = packed.data.shape[2] * (1 if packed.bits == 8 else 8)
    row_start = runs.row * stride
    pixel = np.repeat(row_start + runs.first - begin, length) + np.arange(int(length.sum()))
    return greys_at(packed, pixel), pixel - np.repeat(row_start, length), begin


def greys_at(packed: PackedField, pixel: NDArray[np.int64]) -> NDArray[np.int64]:
    """Gather grey values at flat pixel positions, with rows as long as their bytes."""
    if packed.bits == 8:
        return packed.data.reshape(-1)[pixel].astype(np.int64)
    bytes_there = packed.data.reshape(packed.bits, -1)[:, pixel >> 3]
    bit = bytes_there >> (7 - (pixel & 7)).astype(np.uint8) & 1
    level = np.full(len(pixel), 128 >> packed.bits)
    for plane, value in enumerate(bit):
        level += value * np.int64(128 >> plane)
    return level


SHORT = 1 << 16
"""Values below this fit 16 bits, which numpy sorts by radix."""


class _Above(NamedTuple):
    """Neighbours of every run in the row above.

    Attributes:
        first: (R,) int64, the first run reaching at least the column left of it.
        touches: (R,) bool, True if that run touches it.
        several: (S,) int64, the few runs touched by further ones.
        touching: (S,) int64, the number of runs touching each of those.
    """

    first: NDArray[np.int64]
    touches: Mask
    several: NDArray[np.int64]
    touching: NDArray[np.int64]


def label_runs(runs: Runs) -> tuple[NDArray[np.int64], int]:
    """Label the component of every run; diagonal neighbours are connected.

    Components are numbered from 0 in the order of their first row and column. Correct for every shape: where
    a run has several neighbours in the row above (a U, a ring, a comb), the trees meeting there are merged.

    Returns:
        (R,) int64 labels, and the number of components.
    """
    above = _neighbours_above(runs)
    own = np.arange(len(runs.row))
    parent = _roots(np.where(above.touches, above.first, own))
    if above.several.size:
        parent = _unite(parent, *_further_edges(above))
    is_root = parent == own
    return (np.cumsum(is_root) - 1)[parent], int(np.count_nonzero(is_root))


def by_component(runs: Runs) -> tuple[Runs, NDArray[np.int64], int]:
    """Sort runs by component, row and column; return them with their labels and the number of components."""
    label, count = label_runs(runs)
    order = short(label, count).argsort(kind="stable")
    return runs.taken(order), label[order], count


def short(values: NDArray[np.int64], end: int) -> NDArray[np.integer]:
    """Convert values from 0 to below `end` to a type that numpy sorts six times faster, if they fit."""
    return values.astype(np.uint16) if end <= SHORT else values


def _neighbours_above(runs: Runs) -> _Above:
    # Rows lie farther apart than they are long, so diagonal neighbours never reach round a row's end.
    stride = int(runs.last.max(initial=0)) + 3
    begin = runs.row * stride
    start, end = begin + runs.first, begin + runs.last
    reach = end - (stride - 1)
    first = end.searchsorted(start - (stride + 1))
    start_or_none = np.append(start, np.iinfo(np.int64).max)
    several = (start_or_none[first + 1] <= reach).nonzero()[0]
    touching = start.searchsorted(reach[several], side="right") - first[several]
    return _Above(first, start_or_none[first] <= reach, several, touching)


def _roots(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find every run's root, where each points to an earlier run or itself; chains halve with every step."""
    while True:
        further = parent[parent]
        if (further == parent).all():
            return parent
        parent = further


def _further_edges(above: _Above) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges to the second and later neighbours above."""
    extra = above.touching - 1
    lower = np.repeat(above.several, extra)
    ordinal = np.arange(len(lower)) - np.repeat(np.cumsum(extra) - extra, extra)
    return lower, above.first[lower] + 1 + ordinal


def _unite(
    parent: NDArray[np.int64], lower: NDArray[np.int64], upper: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Join the ends of every edge by hooking the later root to the earlier, until none differ."""
    while True:
        a, b = parent[lower], parent[upper]
        apart = a != b
        if not apart.any():
            return parent
        lower, upper, a, b = lower[apart], upper[apart], a[apart], b[apart]
        # minimum.at: several edges may hook the same root, and the earliest of them must win.
        parent = parent.copy()
        np.minimum.at(parent, np.maximum(a, b), np.minimum(a, b))
        parent = _roots(parent)


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """N components in the field's own rows and columns.

    Attributes:
        pixels: (N,) int64, number of set pixels.
        first_row, last_row: (N,) int64, vertical extent.
        first_column, last_column: (N,) int64, horizontal extent.
    """

    pixels: NDArray[np.int64]
    first_row: NDArray[np.int64]
    last_row: NDArray[np.int64]
    first_column: NDArray[np.int64]
    last_column: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pixels)

    def touch_border(self, rows: int, columns: int) -> Mask:
        """(N,) bool: True for components that touch the edge of a field of this size."""
        across: Mask = (self.first_row == 0) | (self.last_row == rows - 1)
        along: Mask = (self.first_column == 0) | (self.last_column == columns - 1)
        return across | along


def shapes_of(runs: Runs, label: NDArray[np.int64], count: int) -> Shapes:
    """Compute size and extent of every component from runs ordered by component, row and column."""
    end = np.cumsum(np.bincount(label, minlength=count))
    begin = np.append(0, end[:-1])[:count]
    return Shapes(
        pixels=np.add.reduceat(runs.last - runs.first + 1, begin),
        first_row=runs.row[begin],
        last_row=runs.row[end - 1],
        first_column=np.minimum.reduceat(runs.first, begin),
        last_column=np.maximum.reduceat(runs.last, begin),
    )


def binary_centres(runs: Runs, label: NDArray[np.int64], count: int) -> Array:
    """(N, 2) float64 column and row of each component's centre, all pixels weighted equally."""
    length = runs.last - runs.first + 1
    total = np.bincount(label, length, count)
    centres = np.empty((count, 2))
    centres[:, 0] = np.bincount(label, length * (runs.first + runs.last), count) / (2 * total)
    centres[:, 1] = np.bincount(label, length * runs.row, count) / total
    return centres


def grey_centres(
    packed: PackedField, runs: Runs, label: NDArray[np.int64], count: int
) -> tuple[Array, Array]:
    """Compute centres weighted with the grey value above the threshold, and the sum of these weights.

    Returns:
        (N, 2) float64 column and row; (N,) float64 weights in grey values times pixels.
    """
    grey, column, begin = run_greys(packed, runs)
    weight = grey - packed.threshold
    in_run = np.add.reduceat(weight, begin)
    total = np.bincount(label, in_run, count).astype(np.float64)
    x = np.bincount(label, np.add.reduceat(weight * column, begin), count) / total
    return np.stack([x, np.bincount(label, in_run * runs.row, count) / total], axis=1), total
