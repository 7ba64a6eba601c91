"""Rows shifted sideways from some row of a field onwards, as after a lost USB packet.

Blocks of rows are correlated along the line with those of the previous field, for every shift at once.
Motion moves a target by a few pixels per field, and the two halves of the picture in opposite directions;
lost data moves everything below one row by the same number of columns, wrapping round the end of the line,
and nothing above it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd.core.kernel import KERNEL, Kernel

Rows = NDArray[np.uint8]
Profiles = NDArray[np.int16]
Reals = NDArray[np.float64]
Singles = NDArray[np.float32]
Number = TypeVar("Number", np.float32, np.float64)

_BLOCK_ROWS = 12
_BIN_COLUMNS = 4
_LEAST_BINS = 2
_LEAST_LIKENESS = 0.6
"""Correlation with the previous field that a shift must reach."""
_MOTION = range(-3, 4)
"""Columns by which the whole picture may really move from field to field."""
_LEAST_COARSE_GAIN = 0.05
_LEAST_GAIN = 2.0
"""Least ratio of the residual contrast without the shift to that with it."""
_LEAST_SHARE = 0.02
"""Least share of the field's contrast both above and below the first shifted row."""
_LEAST_SIGMA = 2.0
"""Least contrast in grey values of a block's means over 4 columns by 12 rows."""


class Shift(NamedTuple):
    """Every row from `row` on is `columns` too far right (negative: left), wrapping round the end of the
    line.
    """

    row: int
    columns: int


def profiles_shape(rows: int, columns: int) -> tuple[int, int]:
    """Shape of `profiles` of a field."""
    return rows // _BLOCK_ROWS, columns // _BIN_COLUMNS


def profiles(rows: Rows, out: Profiles) -> None:
    """Compute means of blocks of 12 rows in bins of 4 columns, rounded half up.

    The last block has the remaining rows as well; remaining columns are left out.
    """
    import cv2  # noqa: PLC0415 - 16 MB, for installations without the compiled kernel

    blocks, bins = out.shape
    if not out.size:
        return
    columns = np.empty((blocks, rows.shape[1]), np.float32)
    heights = np.full(blocks, _BLOCK_ROWS)
    heights[-1] = len(rows) - (blocks - 1) * _BLOCK_ROWS
    for block, height in enumerate(heights):
        first = block * _BLOCK_ROWS
        cv2.reduce(rows[first : first + height], 0, cv2.REDUCE_SUM, columns[block : block + 1], cv2.CV_32F)
    sums = sum(columns[:, k : _BIN_COLUMNS * bins : _BIN_COLUMNS] for k in range(_BIN_COLUMNS))
    count = _BIN_COLUMNS * heights[:, np.newaxis]
    out[:] = (sums + count // 2) // count


def find_shift(
    rows: Rows, before: Rows, now: Profiles, then: Profiles, kernel: Kernel | None = KERNEL
) -> Shift | None:
    """Find the shift of a field relative to one a few hundredths of a second older, or None.

    A shift can be found only if there is contrast both above and below it. Shifts under 8 columns are taken
    for motion.

    Args:
        rows: (rows, columns) grey values.
        before: Grey values of the earlier field.
        now: `profiles` of `rows`.
        then: `profiles` of `before`.
        kernel: The compiled kernel, or None for numpy.
    """
    coarse = coarse_shift(now, then) if kernel is None else Coarse(*kernel.shifted(now, then, *now.shape))
    if coarse is None or coarse.block < 0:
        return None
    columns = _fine_columns(rows, before, coarse)
    if columns is None:
        return None
    half = rows.shape[1] // 2
    row = _first_row(rows, before, coarse, columns)
    return Shift(row, (columns + half) % (2 * half) - half)


class Coarse(NamedTuple):
    """The first shifted block, or −1, and the number of bins."""

    block: int
    bins: int


def coarse_shift(now: Profiles, then: Profiles) -> Coarse | None:
    """Find the first block and the shift that fit best, if the evidence suffices.

    All sums are of whole numbers below 2⁵³, so the kernel finds the same.
    """
    bins = now.shape[1]
    if not now.size:
        return None
    one, other = now.astype(np.float64), then.astype(np.float64)
    power = np.sqrt(_product(one, one) * _product(other, other))
    if power.max() < _LEAST_SIGMA**2 * bins**2:
        return None
    below = _from_below(power)
    candidates = _candidates(below, _from_below(_product(one, other)))
    if not candidates.size:
        return None
    correlated = _correlated(one, other)
    gain = _from_below(correlated - correlated[:, :1])[candidates]
    # Less than two bins to either side, wrapping round the end of the line, may be motion.
    gain[:, :_LEAST_BINS] = gain[:, 1 - _LEAST_BINS :] = 0
    best, shift = np.unravel_index(int(gain.argmax()), gain.shape)
    block = int(candidates[best])
    telling = bins * gain[best, shift] >= _LEAST_COARSE_GAIN * below[block]
    return Coarse(block, int(shift)) if telling else None


def _product(one: Reals, other: Reals) -> Reals:
    """(blocks,) scalar products without the means, times the number of bins."""
    return one.shape[1] * np.einsum("ij,ij->i", one, other) - one.sum(axis=1) * other.sum(axis=1)


def _candidates(below: Reals, unshifted_below: Reals) -> NDArray[np.intp]:
    """Blocks with contrast above that has not moved, and contrast below that has."""
    above, unshifted_above = below[0] - below, unshifted_below[0] - unshifted_below
    candidates = (
        (np.minimum(below, above) >= _LEAST_SHARE * below[0])
        & (unshifted_above >= _LEAST_LIKENESS * above)
        & (below - unshifted_below >= _LEAST_COARSE_GAIN * below)
    )
    return np.flatnonzero(candidates)


def _correlated(now: Reals, then: Reals) -> Reals:
    """(blocks, bins): product of each block with the earlier one shifted right by that many bins."""
    spectrum = np.fft.rfft(now) * np.conj(np.fft.rfft(then))
    return np.rint(np.fft.irfft(spectrum, now.shape[1]))


def _fine_columns(rows: Rows, before: Rows, coarse: Coarse) -> int | None:
    """The shift in pixels, if it makes the previous field match well below, and much better than motion does.

    Above, it must not: what changes all over the picture may look like a shift, as a running counter does.
    """
    now, then = _smooth(rows), _smooth(before)
    middle = coarse.bins * _BIN_COLUMNS
    near = range(middle - _BIN_COLUMNS, middle + _BIN_COLUMNS + 1)
    above, below = (
        _likeness(now[part], then[part], (*near, *_MOTION))
        for part in (slice(coarse.block), slice(coarse.block, None))
    )
    shifted = max(near, key=below.__getitem__)
    rest, unshifted_rest = 1 - below[shifted], 1 - max(below[shift] for shift in _MOTION)
    fits = below[shifted] >= _LEAST_LIKENESS and unshifted_rest >= _LEAST_GAIN * rest
    is_below_alone = above[shifted] < max(above[shift] for shift in _MOTION)
    return shifted if fits and is_below_alone else None


def _likeness(now: Singles, then: Singles, shifts: Sequence[int]) -> dict[int, float]:
    """Correlation of some blocks with earlier ones that are shifted right by so many columns."""
    power = math.sqrt(float(np.vdot(now, now)) * float(np.vdot(then, then)))
    return {shift: float(np.vdot(now, np.roll(then, shift, axis=1))) / power for shift in shifts}


def _smooth(rows: Rows) -> Singles:
    """(blocks, columns) running means of 12 rows by 4 columns, wrapping round the end of the line."""
    edges = np.linspace(0, len(rows), _blocks(rows) + 1).round().astype(np.intp)
    means: Singles = np.add.reduceat(rows, edges[:-1], axis=0, dtype=np.float32)
    means /= np.diff(edges)[:, np.newaxis]
    means -= means.mean(axis=1, keepdims=True)
    return sum((np.roll(means, k, axis=1) for k in range(1, _BIN_COLUMNS)), start=means)


def _from_below(values: NDArray[Number]) -> NDArray[Number]:
    """Sums from each block, or row, to the last."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _first_row(rows: Rows, before: Rows, coarse: Coarse, columns: int) -> int:
    """First row from which the shift fits better; exact to the row where there is contrast."""
    middle = coarse.block * _BLOCK_ROWS
    first = max(0, middle - _BLOCK_ROWS)
    near = slice(first, middle + 2 * _BLOCK_ROWS)
    now, then = (_centred(one[near]) for one in (rows, before))
    gain = (now * (np.roll(then, columns, axis=1) - then)).sum(axis=1)
    return first + int(np.argmax(_from_below(gain)))


def _centred(rows: Rows) -> Singles:
    grey = rows.astype(np.float32)
    grey -= grey.mean(axis=1, keepdims=True)
    return grey


def _blocks(rows: Rows) -> int:
    return max(1, len(rows) // _BLOCK_ROWS)
