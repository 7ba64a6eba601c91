"""Rows that lie too far left or right from some row of a field on, as after a lost USB packet.

Blocks of rows are correlated along the line with those of the field before, for every shift at once. Motion
moves a target by a few pixels from field to field and the two halves of the picture apart; lost data moves
everything below one row by the same number of columns, round the end of the line, and nothing above it.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

Rows = NDArray[np.uint8]
Profiles = NDArray[np.float32]

_BLOCK_ROWS = 12
_BIN_COLUMNS = 4
_LEAST_BINS = 2
_LEAST_LIKENESS = 0.6
"""Correlation with the field before at the shift that is found."""
_MOTION = range(-3, 4)
"""Columns that a whole picture may move from field to field."""
_LEAST_COARSE_GAIN = 0.05
_LEAST_GAIN = 2.0
"""How many times more of the contrast is left over without the shift than with it."""
_LEAST_SHARE = 0.02
"""Of the field's contrast, below the first shifted row and above it."""
_LEAST_SIGMA = 2.0
"""Grey values, of a block's means of 4 columns by 12 rows: there is something to see."""


class Shift(NamedTuple):
    """Every row from `row` on lies `columns` too far right (negative: left), round the end of the line."""

    row: int
    columns: int


def profiles(rows: Rows) -> Profiles:
    """(blocks, bins) means of 12 rows by 4 columns, less each block's mean."""
    size = (max(1, rows.shape[1] // _BIN_COLUMNS), _blocks(rows))
    means = cv2.resize(rows, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    means -= means.mean(axis=1, keepdims=True)
    return means


def find_shift(rows: Rows, before: Rows, now: Profiles, then: Profiles) -> Shift | None:
    """The shift of a field against one that came a few hundredths of a second before, or None.

    A shift is found where there is contrast, above it and below it. Under 8 columns it is taken for motion.

    Args:
        rows: (rows, columns) grey values.
        before: those of the earlier field.
        now: `profiles` of `rows`.
        then: `profiles` of `before`.
    """
    coarse = _coarse_shift(now, then)
    if coarse is None:
        return None
    columns = _fine_columns(rows, before, coarse)
    if columns is None:
        return None
    half = rows.shape[1] // 2
    row = _first_row(rows, before, coarse, columns)
    return Shift(row, (columns + half) % (2 * half) - half)


class _Coarse(NamedTuple):
    block: int
    columns: int


def _coarse_shift(now: Profiles, then: Profiles) -> _Coarse | None:
    """The first block and the shift that fit best, if anything speaks for them."""
    power = np.sqrt((now * now).sum(axis=1) * (then * then).sum(axis=1))
    if power.max() < _LEAST_SIGMA**2 * now.shape[1]:
        return None
    unshifted = (now * then).sum(axis=1)
    blocks = _candidates(power, unshifted)
    if not blocks.size:
        return None
    gain = _from_below(_correlated(now, then))[blocks] - _from_below(unshifted)[blocks, np.newaxis]
    gain[:, :_LEAST_BINS] = gain[:, 1 - _LEAST_BINS :] = 0
    best, bins = np.unravel_index(int(gain.argmax()), gain.shape)
    block = int(blocks[best])
    telling = gain[best, bins] >= _LEAST_COARSE_GAIN * power[block:].sum()
    return _Coarse(block, int(bins) * _BIN_COLUMNS) if telling else None


def _candidates(power: Profiles, unshifted: Profiles) -> NDArray[np.intp]:
    """Blocks with contrast above, that is where it was, and contrast below, that is not all where it was."""
    below, unshifted_below = _from_below(power), _from_below(unshifted)
    above, unshifted_above = below[0] - below, unshifted_below[0] - unshifted_below
    candidates = (
        (np.minimum(below, above) >= _LEAST_SHARE * below[0])
        & (unshifted_above >= _LEAST_LIKENESS * above)
        & (below - unshifted_below >= _LEAST_COARSE_GAIN * below)
    )
    return np.flatnonzero(candidates)


def _correlated(now: Profiles, then: Profiles) -> Profiles:
    """(blocks, bins): each block's product with the earlier one's, shifted to the right by so many bins."""
    spectrum = scipy.fft.rfft(now) * np.conj(scipy.fft.rfft(then))
    correlated: Profiles = scipy.fft.irfft(spectrum, now.shape[1])
    return correlated


def _fine_columns(rows: Rows, before: Rows, coarse: _Coarse) -> int | None:
    """The shift to the pixel, if it makes the field before fit well and much better than motion does."""
    now, then = (_smooth(one)[coarse.block :] for one in (rows, before))
    power = math.sqrt(float(np.vdot(now, now)) * float(np.vdot(then, then)))
    near = range(coarse.columns - _BIN_COLUMNS, coarse.columns + _BIN_COLUMNS + 1)
    likeness = {shift: _likeness(now, then, shift) / power for shift in (*near, *_MOTION)}
    shifted = max(near, key=likeness.__getitem__)
    rest, unshifted_rest = 1 - likeness[shifted], 1 - max(likeness[shift] for shift in _MOTION)
    fits = likeness[shifted] >= _LEAST_LIKENESS and unshifted_rest >= _LEAST_GAIN * rest
    return shifted if fits else None


def _smooth(rows: Rows) -> Profiles:
    """(blocks, columns) running means of 12 rows by 4 columns, round the end of the line."""
    means = cv2.resize(rows, (rows.shape[1], _blocks(rows)), interpolation=cv2.INTER_AREA).astype(np.float32)
    means -= means.mean(axis=1, keepdims=True)
    smooth: Profiles = sum((np.roll(means, k, axis=1) for k in range(1, _BIN_COLUMNS)), start=means)
    return smooth


def _likeness(now: Profiles, then: Profiles, shift: int) -> float:
    return float(np.vdot(now, np.roll(then, shift, axis=1)))


def _from_below(values: Profiles) -> Profiles:
    """Sums from each block to the last."""
    sums: Profiles = np.cumsum(values[::-1], axis=0)[::-1]
    return sums


def _first_row(rows: Rows, before: Rows, coarse: _Coarse, columns: int) -> int:
    """The row from which on the shift fits better; to the row where there is contrast."""
    middle = coarse.block * _BLOCK_ROWS
    first = max(0, middle - _BLOCK_ROWS)
    near = slice(first, middle + 2 * _BLOCK_ROWS)
    now, then = (_centred(one[near]) for one in (rows, before))
    gain = (now * (np.roll(then, columns, axis=1) - then)).sum(axis=1)
    return first + int(np.argmax(_from_below(gain)))


def _centred(rows: Rows) -> Profiles:
    grey = rows.astype(np.float32)
    grey -= grey.mean(axis=1, keepdims=True)
    return grey


def _blocks(rows: Rows) -> int:
    return max(1, len(rows) // _BLOCK_ROWS)
