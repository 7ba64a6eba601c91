"""Target mask of a packed field as packed bits, and the grey values inside it."""

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling.runs import Runs


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
    plane: NDArray[np.uint8] = data[0]
    return plane


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
