"""Video fields: their lines, grey values and packed bits (paper 3.3 and 3.4).

An interlaced frame is split into two fields; the missing lines of a field may be interpolated; grey values
are quantised to a few bits and packed, as the ring and the capture file keep them. Every field carries `y0`
and `y_step`, so that row `k` is frame line `y0 + k * y_step` and no later room needs to know about parity; a
progressive picture is a field with all its lines. The compiled kernel packs in one pass if the installation
has one, else numpy, by `double_lines` and `quantise`, which the kernel equals bit for bit.
"""

from copy import copy
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.kernel import KERNEL, Kernel

__all__ = [
    "BIT_DEPTHS",
    "BOTTOM",
    "LARGEST_SIDE_PX",
    "NTSC_HZ",
    "PAL_HZ",
    "PARITIES",
    "PROGRESSIVE",
    "TOP",
    "VIDEO_LINES",
    "Field",
    "FieldOrder",
    "KernelPacking",
    "NumberedField",
    "PackedField",
    "Packing",
    "double_lines",
    "map_level",
    "pack",
    "quantise",
    "split_frame",
    "standard_rate_hz",
    "unpack",
]

TOP = 0
"""Parity of the field with frame lines 0, 2, 4 …; for PAL the older one of a frame."""
BOTTOM = 1
"""Parity of the field with frame lines 1, 3, 5 …"""
PARITIES = {"top": TOP, "bottom": BOTTOM}
"""Parities by the names that options have for them."""
PROGRESSIVE = 2
"""In place of a parity: a picture of a progressive camera, which has every line of the frame."""
BIT_DEPTHS = (1, 2, 3, 4, 5, 6, 8)
"""Bit depths that a field can be quantised to."""
LARGEST_SIDE_PX = 4096
"""Lines or columns of the largest picture that is taken from outside; a PAL frame has 576 and 720."""
INTERPOLATIONS = ("linear", "kernel3x3")
"""Methods of interpolation: "linear" between the lines above and below; "kernel3x3" by the kernel ¼ (1 2 1)
by ½ (1 2 1), which is the same but smooths every line along x as well."""
MEDIAN_EVERY = 8
"""Pixels between samples, each way, for the median of a threshold map: the map is smooth, so few suffice."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Grey values of one field; row k is frame line `y0 + k * y_step`.

    A progressive picture is a field that has all lines: every camera's pictures are fields from here on.

    Attributes:
        luma: (rows, columns) uint8. Often a view into a driver's buffer: copy it to keep it.
        parity: `TOP` or `BOTTOM`, of the field that the camera delivered, or `PROGRESSIVE`.
        y0: Frame line of row 0.
        y_step: Frame lines from row to row: 2 if intact, 1 if the missing lines have been interpolated or
            none is missing.
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

    @classmethod
    def progressive(cls, luma: NDArray[np.uint8]) -> "Field":
        """Make a field of a whole progressive picture; luma (lines, columns) uint8."""
        return cls(luma, PROGRESSIVE, y0=0, y_step=1)

    @property
    def rows(self) -> int:
        """Number of rows of `luma`."""
        return int(self.luma.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns of `luma`."""
        return int(self.luma.shape[1])

    @property
    def lines_apart(self) -> int:
        """Frame lines from one line that the camera delivered to the next, whatever the rows are."""
        return 1 if self.parity == PROGRESSIVE else 2


def split_frame(frame: NDArray[np.uint8], older: int = TOP) -> tuple[Field, Field]:
    """Split an interlaced frame into its two fields, the older first; views, not copies.

    Args:
        frame: (lines, columns) uint8 with an even number of lines.
        older: Parity that was exposed first: `TOP` for PAL, `BOTTOM` for some drivers.
    """
    first, second = (Field.intact(frame[parity::2], parity) for parity in (older, 1 - older))
    return first, second


def double_lines(field: Field, interpolation: str = "linear") -> Field:
    """Interpolate the missing lines of a field on its grey values, giving a picture of full height.

    Only before the threshold does that gain anything: linearly interpolated bits have exactly the centroid of
    the intact ones, and a second threshold makes it worse.

    A missing line is the mean of its neighbours, rounded half up; beyond the outermost line the only
    neighbour is repeated. A field already doubled is returned as it is, so a recording of doubled fields
    passes through unchanged, and so does a progressive picture. The field must have at least two rows.

    Raises:
        ValueError: The interpolation is not one of `INTERPOLATIONS`.
    """
    smooths = smooths_lines(interpolation)
    if field.y_step == 1:
        return field
    import cv2  # noqa: PLC0415 - 16 MB, and the compiled kernel doubles without it

    luma = _smoothed(field.luma) if smooths else field.luma
    rows, columns = luma.shape
    doubled = np.empty((2 * rows, columns), np.uint8)
    doubled[field.parity :: 2] = luma
    # cv2 rounds half to even; a quarter added makes every .5 round up.
    between = cv2.addWeighted(luma[:-1], 0.5, luma[1:], 0.5, 0.25)
    doubled[1 + field.parity : 2 * rows - 1 + field.parity : 2] = between
    doubled[-1 if field.parity == 0 else 0] = luma[-1 if field.parity == 0 else 0]
    return Field(doubled, field.parity, y0=0, y_step=1)


def smooths_lines(interpolation: str) -> bool:
    """True if an interpolation smooths every line along x as well.

    Raises:
        ValueError: The interpolation is not one of `INTERPOLATIONS`.
    """
    if interpolation not in INTERPOLATIONS:
        raise ValueError(f"unknown interpolation {interpolation!r}; choose from {', '.join(INTERPOLATIONS)}")
    return interpolation != "linear"


def _smoothed(luma: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Smooth every line by ¼ (1 2 1) along x, repeating the outermost pixel at the ends."""
    import cv2  # noqa: PLC0415 - see `doubled`

    row = np.array([0.25, 0.5, 0.25], np.float32)
    smoothed = cv2.sepFilter2D(luma, cv2.CV_8U, row, np.ones(1, np.float32), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smoothed, np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class PackedField:
    """A quantised field.

    Attributes:
        data: uint8, C-contiguous. Up to 6 bits: (bits, rows, ceil(columns / 8)), one plane a bit, the most
            significant first, eight pixels a byte with the leftmost in its highest bit. 8 bits: (1, rows,
            columns).
        bits: Bits per pixel, one of `BIT_DEPTHS`.
        columns: Pixels per row.
        parity: Parity of the field that the camera delivered, or `PROGRESSIVE`.
        y0: Frame line of row 0.
        y_step: Frame lines from row to row.
        threshold: Grey value in force: at 1 bit a pixel is set if its luma exceeds it; with more bits it is
            the level that separates targets from background.
        marks: (K, 3) float32, places of the marks in its grey values before they were quantised, see
            `core.measurement.marks`; None if none were looked for.
    """

    data: NDArray[np.uint8]
    bits: int
    columns: int
    parity: int
    y0: int
    y_step: int
    threshold: int
    marks: NDArray[np.float32] | None = field(default=None, init=False, repr=False)

    def with_marks(self, marks: NDArray[np.float32] | None) -> "PackedField":
        """The same field, of the same memory, with the marks located in its grey values."""
        marked = copy(self)
        object.__setattr__(marked, "marks", marks)
        return marked

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.data.shape[1])

    @property
    def frame_lines(self) -> int:
        """Number of lines of the frame that it belongs to."""
        return self.rows * self.y_step

    @property
    def is_doubled(self) -> bool:
        """True if every other row has been interpolated."""
        return self.y_step == 1 and self.parity != PROGRESSIVE

    @property
    def lines_apart(self) -> int:
        """Frame lines from one line that the camera delivered to the next, whatever the rows are."""
        return 1 if self.parity == PROGRESSIVE else 2

    @property
    def lines(self) -> tuple[int, int]:
        """Frame lines from row to row, and from one line that the camera delivered to the next."""
        return self.y_step, self.lines_apart

    @property
    def first_delivered(self) -> int:
        """Row of the first line that the camera delivered."""
        return self.parity if self.is_doubled else 0


class NumberedField(NamedTuple):
    """A packed field with its number and time.

    Attributes:
        n: Nominal steps (20 ms in PAL) since numbering began, lost fields included.
        time_ns: Middle of the exposure, CLOCK_MONOTONIC.
        sequence: The driver's own count, or None if it has none.
        packed: The field.
    """

    n: int
    time_ns: int
    sequence: int | None
    packed: PackedField


def packed_shape(rows: int, columns: int, bits: int) -> tuple[int, int, int]:
    """Shape of `PackedField.data`."""
    return (1, rows, columns) if bits == 8 else (bits, rows, -(-columns // 8))


def quantise(field: Field, bits: int, threshold: int | NDArray[np.uint8]) -> PackedField:
    """Quantise a field to `bits` bits per pixel and pack it; the result shares no memory with `field`.

    At 1 bit a pixel is set if luma > threshold; with more, the most significant bits are kept.

    Args:
        field: Grey values.
        bits: One of `BIT_DEPTHS`.
        threshold: One for all pixels; or, at 1 bit, (rows, columns) uint8, one for each, whose median becomes
            the packed field's.

    Raises:
        ValueError: A threshold map was given for more than 1 bit, or has another shape than the field.
    """
    if not isinstance(threshold, np.ndarray):
        return _packed(field, bits, threshold, threshold)
    if bits != 1 or threshold.shape != field.luma.shape:
        raise ValueError(
            f"a threshold map of shape {threshold.shape} does not fit a field of {field.luma.shape} "
            f"at {bits} bits"
        )
    return _packed(field, bits, threshold, map_level(threshold))


def map_level(by_pixel: NDArray[np.uint8]) -> int:
    """Compute the level of a threshold map (rows, columns): the median of a part of its pixels."""
    return int(np.median(by_pixel[::MEDIAN_EVERY, ::MEDIAN_EVERY]))


def _packed(field: Field, bits: int, threshold: int | NDArray[np.uint8], level: int) -> PackedField:
    return PackedField(
        _planes(field.luma, bits, threshold), bits, field.columns, field.parity, field.y0, field.y_step, level
    )


def _planes(luma: NDArray[np.uint8], bits: int, threshold: int | NDArray[np.uint8]) -> NDArray[np.uint8]:
    if bits == 8:
        return luma[np.newaxis].copy()
    if bits == 1:
        return np.packbits(luma > threshold, axis=1)[np.newaxis]
    return np.stack([np.packbits(luma & (128 >> plane), axis=1) for plane in range(bits)])


def unpack(packed: PackedField) -> Field:
    """Restore grey values: 0 and 255 at 1 bit, the original luma at 8 bits, else the middle of each level.

    At 8 bits the luma is a view into the packed data, otherwise it is new. Quantising the result again with
    the same number of bits (and any threshold from 0 to 254 at 1 bit) gives the same planes.
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


PAL_HZ = 50.0
NTSC_HZ = 60_000 / 1001
"""Fields per second of the video with 625 and with 525 lines."""
_NTSC_LINES = (480, 486)
VIDEO_LINES = (576, *_NTSC_LINES)
"""Lines of an interlaced frame; pictures with another number are progressive."""


def standard_rate_hz(frame_lines: int) -> float:
    """Fields per second of the video standard whose frames have so many lines to be seen."""
    return NTSC_HZ if frame_lines in _NTSC_LINES else PAL_HZ


class FieldOrder(StrEnum):
    """Order in which a driver delivers the fields of a frame."""

    ALTERNATE = "alternate"
    TOP_FIRST = "top_first"
    BOTTOM_FIRST = "bottom_first"
    ONE_PARITY = "one_parity"
    PROGRESSIVE = "progressive"
    """No fields: whole pictures, each of which is taken for a field with all its lines."""

    @property
    def has_parity(self) -> bool:
        """True if fields of both parities come by turns."""
        return self not in (FieldOrder.ONE_PARITY, FieldOrder.PROGRESSIVE)
