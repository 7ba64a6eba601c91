"""Packing of fields for a ring: their lines doubled, quantised and packed in one pass.

The compiled kernel does it if the installation has one, else numpy, by `double_lines` and `quantise`, which
the kernel equals bit for bit.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field.field import (
    PROGRESSIVE,
    Field,
    PackedField,
    double_lines,
    packed_shape,
    quantise,
    smooths_lines,
)
from grabberd.core.kernel import KERNEL, Kernel

NO_MAP: NDArray[np.uint8] = np.empty(0, np.uint8)
"""For the kernel: one threshold for all pixels."""


class Packing(NamedTuple):
    """Bits, lines and threshold that fields are packed with.

    Attributes:
        bits: One of `BIT_DEPTHS`.
        doubled: True if missing lines are interpolated first; a field that is doubled already is left as it
            is.
        threshold: Grey value for all pixels, or the level of the map.
        by_pixel: At 1 bit, a threshold for every pixel of the packed rows, (rows, columns) uint8, if there is
            one. A field of another size is packed with the level.
        interpolation: See `double_lines`.
    """

    bits: int
    doubled: bool
    threshold: int
    by_pixel: NDArray[np.uint8] | None = None
    interpolation: str = "linear"

    def map_for(self, shape: tuple[int, ...]) -> NDArray[np.uint8] | None:
        """The threshold map for packed rows of this shape, or None if the level applies."""
        fits = self.bits == 1 and self.by_pixel is not None and self.by_pixel.shape == shape
        return self.by_pixel if fits else None


class KernelPacking(NamedTuple):
    """Arguments of the kernel for the packing of one field, besides its lines.

    Attributes:
        how: Bits, whether to double, whether to smooth, parity, threshold.
        by_pixel: Threshold map, or `NO_MAP`.
        packed: The packed field, whose data the kernel fills.
    """

    how: tuple[int, int, int, int, int]
    by_pixel: NDArray[np.uint8]
    packed: PackedField

    @classmethod
    def of(cls, field: Field, packing: Packing) -> "KernelPacking":
        """Prepare the packing of a field, with memory for the packed one."""
        doubles = packing.doubled and field.y_step != 1
        rows, columns = field.luma.shape
        rows = 2 * rows if doubles else rows
        data = np.empty(packed_shape(rows, columns, packing.bits), np.uint8)
        y0, y_step = (0, 1) if doubles else (field.y0, field.y_step)
        packed = PackedField(data, packing.bits, columns, field.parity, y0, y_step, packing.threshold)
        smooths = int(smooths_lines(packing.interpolation))
        parity = 0 if field.parity == PROGRESSIVE else field.parity  # of lines that are missing
        how = packing.bits, int(doubles), smooths, parity, packing.threshold
        by_pixel = packing.map_for((rows, columns))
        return cls(how, NO_MAP if by_pixel is None else np.ascontiguousarray(by_pixel), packed)


def pack(field: Field, packing: Packing, kernel: Kernel | None = KERNEL) -> PackedField:
    """Pack a field; the result shares no memory with it.

    Args:
        field: Grey values, in whatever strides they lie.
        packing: How to pack it.
        kernel: The compiled kernel, or None for numpy.
    """
    if kernel is None:
        return _pack_by_numpy(field, packing)
    asked = KernelPacking.of(field, packing)
    kernel.pack(field.luma, asked.how, asked.by_pixel, asked.packed.data)
    return asked.packed


def _pack_by_numpy(field: Field, packing: Packing) -> PackedField:
    whole = double_lines(field, packing.interpolation) if packing.doubled else field
    by_pixel = packing.map_for(whole.luma.shape)
    if by_pixel is None:
        return quantise(whole, packing.bits, packing.threshold)
    return replace(quantise(whole, packing.bits, by_pixel), threshold=packing.threshold)
