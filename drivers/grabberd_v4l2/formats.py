"""The luma in a buffer, format by format."""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray


class PixelFormat(NamedTuple):
    """Memory layout of a pixel format.

    Attributes:
        word: type of one pixel; its low byte is the luma, its high byte, if any, chroma.
        planes: size of the whole picture in units of its luma plane.
        is_compressed: True if a buffer has a JPEG, and the layout is that of the decoded luma.
    """

    word: DTypeLike
    planes: float
    is_compressed: bool = False


FORMATS = {
    "GREY": PixelFormat("u1", 1.0),
    "NV12": PixelFormat("u1", 1.5),
    "YUYV": PixelFormat("<u2", 1.0),
    "UYVY": PixelFormat(">u2", 1.0),
    "MJPG": PixelFormat("u1", 1.0, is_compressed=True),
    "JPEG": PixelFormat("u1", 1.0, is_compressed=True),
}
"""The formats that can be read, the preferred ones first.

The first four have the same 8-bit luma, so the order is that of effort: GREY carries nothing else, NV12 half
as much again, YUYV and UYVY twice as much, and their luma has to be extracted, which takes longer for UYVY. A
JPEG has to be decoded, and its luma is not quite the camera's; only digital cameras deliver it.
"""
RAW = tuple(fourcc for fourcc, one in FORMATS.items() if not one.is_compressed)


def luma(
    buffer: NDArray[np.uint8],
    fourcc: str,
    lines: int,
    columns: int,
    bytes_per_line: int,
    rows: slice = slice(None),
) -> NDArray[np.uint8]:
    """Grey values of some lines, with contiguous pixels.

    The result is a view into the buffer if its pixels are contiguous (GREY, NV12), otherwise a copy without
    the chroma: one copy takes a fifth of the extra time that doubling lines of strided pixels would take.

    Args:
        buffer: (n,) uint8, at least `needed_bytes`.
        fourcc: one of `FORMATS`.
        lines: lines of the picture.
        columns: pixels per line.
        bytes_per_line: distance of two lines in bytes.
        rows: the lines to extract.

    Returns:
        (rows, columns) uint8.

    Raises:
        ValueError: the buffer is too short.
    """
    used = columns * bytes_per_pixel(fourcc)
    length = (lines - 1) * bytes_per_line + used
    if buffer.size < length:
        raise ValueError(f"{lines} lines of {fourcc} need {length} bytes, the buffer has {buffer.size}")
    # The last line need not be padded, so this is no reshape.
    picture = np.ndarray((lines, used), np.uint8, buffer, strides=(bytes_per_line, 1))
    return picture[rows].view(FORMATS[fourcc].word).astype(np.uint8, copy=False)


def bytes_per_pixel(fourcc: str) -> int:
    """Bytes per pixel in the plane that contains the luma."""
    return np.dtype(FORMATS[fourcc].word).itemsize


def needed_bytes(fourcc: str, lines: int, columns: int, bytes_per_line: int) -> int:
    """Bytes of a whole picture, chroma included; a buffer with fewer is truncated."""
    padding = bytes_per_line - columns * bytes_per_pixel(fourcc)
    return int(lines * FORMATS[fourcc].planes) * bytes_per_line - padding
