"""A field quantised to a few bits and packed, as the ring and the capture file keep it (paper 3.4)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.field.field import Field

BIT_DEPTHS = (1, 2, 3, 4, 5, 6, 8)
"""The bit depths that a field can be quantised to."""
MEDIAN_EVERY = 8
"""Of a smooth map of thresholds one pixel in so many, each way, tells the median."""


@dataclass(frozen=True, slots=True, eq=False)
class PackedField:
    """A quantised field.

    Attributes:
        data: uint8, C-contiguous. Up to 6 bits: (bits, rows, ceil(columns / 8)), one plane a bit, the most
            significant first, eight pixels a byte with the leftmost in its highest bit. 8 bits: (1, rows,
            columns).
        bits: bits a pixel, one of `BIT_DEPTHS`.
        columns: pixels a row.
        parity: of the field that the camera delivered.
        y0: frame line of row 0.
        y_step: frame lines from row to row.
        threshold: the grey value in force: at 1 bit a pixel is set where its luma exceeds it; with more bits
            it is the level that separates target from background.
    """

    data: NDArray[np.uint8]
    bits: int
    columns: int
    parity: int
    y0: int
    y_step: int
    threshold: int

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.data.shape[1])


class NumberedField(NamedTuple):
    """A packed field and its place in time.

    Attributes:
        n: nominal 20 ms steps since the numbering began, lost fields included.
        time_ns: middle of the exposure, CLOCK_MONOTONIC.
        sequence: the driver's own count, or None where it has none.
        packed: the field.
    """

    n: int
    time_ns: int
    sequence: int | None
    packed: PackedField


def packed_shape(rows: int, columns: int, bits: int) -> tuple[int, int, int]:
    """Shape of `PackedField.data`."""
    return (1, rows, columns) if bits == 8 else (bits, rows, -(-columns // 8))


def quantise(field: Field, bits: int, threshold: int | NDArray[np.uint8]) -> PackedField:
    """The field with `bits` bits a pixel, packed; it shares no memory with `field`.

    At 1 bit a pixel is set where luma > threshold; with more, the most significant bits are kept.

    Args:
        field: grey values.
        bits: one of `BIT_DEPTHS`.
        threshold: of all pixels; or, at 1 bit, (rows, columns) uint8 of each one, whose median is then the
            packed field's.

    Raises:
        ValueError: thresholds pixel by pixel for more than 1 bit, or for a picture of another size.
    """
    if not isinstance(threshold, np.ndarray):
        return _packed(field, bits, threshold, threshold)
    if bits != 1 or threshold.shape != field.luma.shape:
        raise ValueError(
            f"thresholds of shape {threshold.shape} do not fit a field of {field.luma.shape} and {bits} bits"
        )
    median = int(np.median(threshold[::MEDIAN_EVERY, ::MEDIAN_EVERY]))
    return _packed(field, bits, threshold, median)


def _packed(field: Field, bits: int, threshold: int | NDArray[np.uint8], level: int) -> PackedField:
    return PackedField(
        _planes(field.luma, bits, threshold),
        bits,
        field.columns,
        field.parity,
        field.y0,
        field.y_step,
        level,
    )


def _planes(luma: NDArray[np.uint8], bits: int, threshold: int | NDArray[np.uint8]) -> NDArray[np.uint8]:
    if bits == 8:
        return luma[np.newaxis].copy()
    if bits == 1:
        return np.packbits(luma > threshold, axis=1)[np.newaxis]
    return np.stack([np.packbits(luma & (128 >> plane), axis=1) for plane in range(bits)])


def unpack(packed: PackedField) -> Field:
    """Grey values again: 0 and 255 at 1 bit, the middle of each level otherwise, the original luma at 8 bits.

    At 8 bits the luma is a view into the packed data, otherwise it is new.

    Quantising the result again with the same number of bits (and any threshold from 0 to 254 at 1 bit) gives
    the same planes.
    """
    return Field(_levels(packed), packed.parity, packed.y0, packed.y_step)


def _levels(packed: PackedField) -> NDArray[np.uint8]:
    luma: NDArray[np.uint8]
    if packed.bits == 8:
        luma = packed.data[0]
        return luma
    planes = np.unpackbits(packed.data, axis=2, count=packed.columns)
    if packed.bits == 1:
        luma = planes[0] * np.uint8(255)
        return luma
    luma = np.full(planes.shape[1:], 128 >> packed.bits, np.uint8)
    for plane, values in enumerate(planes):
        luma |= values << np.uint8(7 - plane)
    return luma
