"""The luma in a buffer, format by format, JPEG included.

A camera's broken JPEG is told in words and never ends the stream.
"""

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


_SOI, _EOI = b"\xff\xd8", b"\xff\xd9"
_FILL, _SOS, _RESTARTS = 0xFF, 0xDA, 0xDD
_FRAMES = (0xC0, 0xC1, 0xC2)
"""Markers with the picture's size: baseline, extended and progressive coding by Huffman's method."""
_MOST_HEADER = 65_536
_MOST_BODY = 8
"""Bytes of a segment that are looked at."""
_BLOCK = 8
_NOTHING_LEFT = 128
"""Grey of the blocks for which the decoder had no data left."""


class Header(NamedTuple):
    """Header of a picture, as far as it matters.

    Attributes:
        shape: Lines and columns.
        unit_px: Lines and columns of a unit of coding, which holds the blocks of all colours.
        restart_units: Units after which the coding begins anew; 0 if it does not.
    """

    shape: tuple[int, int]
    unit_px: tuple[int, int]
    restart_units: int


class JpegLuma:
    """Decodes one stream's pictures.

    Args:
        lines, columns: size of every picture.
    """

    def __init__(self, lines: int, columns: int) -> None:
        import cv2  # noqa: PLC0415 - 16 MB, for compressed streams alone

        self._cv2 = cv2
        self._how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        self._shape = lines, columns
        self._last: NDArray[np.uint8] | None = None  # whole
        self._grey: NDArray[np.bool_] = np.zeros(0, np.bool_)

    def decode(self, data: NDArray[np.uint8]) -> tuple[NDArray[np.uint8] | None, str | None]:
        """The luma of a picture, and what is wrong with it.

        A picture that breaks off is grey from there on. In place of one that cannot be decoded the last
        whole picture is returned; None if there was none yet.

        Args:
            data: (n,) uint8, as the camera sent them.

        Returns:
            (lines, columns) uint8, and the damage in words, or None.
        """
        header = _header(data[:_MOST_HEADER].tobytes())
        fault = _fault(data, header, self._shape)
        luma = None if fault else self._decoded(data)
        if luma is None or header is None or luma.shape != self._shape:
            return self._last, f"broken JPEG: {fault or 'it cannot be decoded'}"
        # The header alone does not tell: lost bytes in the middle leave too few for the last blocks.
        if self._lacks_data(_without_data(luma, header)):
            return luma, "broken JPEG: data are missing"
        self._last = luma
        return luma, None

    def _lacks_data(self, grey: NDArray[np.bool_]) -> bool:
        """True if data did not suffice; what looks so within one picture after the other is a grey scene."""
        before, self._grey = self._grey, grey
        is_new = grey & ~before if before.shape == grey.shape else np.zeros_like(grey)
        return bool(grey[-1] or is_new.any())

    def _decoded(self, data: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
        if _EOI not in data[-_MOST_HEADER:].tobytes():  # then the decoder would give nothing at all
            data = np.concatenate([data, np.frombuffer(_EOI, np.uint8)])
        try:
            return self._cv2.imdecode(data, self._how)  # type: ignore[return-value]
        except self._cv2.error:
            return None


def _without_data(luma: NDArray[np.uint8], header: Header) -> NDArray[np.bool_]:
    """True where the last unit, of the picture or before the coding begins anew, looks as without data."""
    height, width = header.unit_px
    across = -(-luma.shape[1] // width)
    units = across * -(-luma.shape[0] // height)
    every = header.restart_units or units
    last = np.minimum(np.arange(every - 1, units + every - 1, every), units - 1)
    # The first block of a unit: the other ones may lie outside of the picture.
    lines, columns = last // across * height, last % across * width
    grey: NDArray[np.bool_] = luma[lines, columns] == _NOTHING_LEFT
    for end in np.flatnonzero(grey).tolist():
        block = luma[lines[end] : lines[end] + _BLOCK, columns[end] : columns[end] + _BLOCK]
        grey[end] = (block == _NOTHING_LEFT).all()
    return grey


def _fault(data: NDArray[np.uint8], header: Header | None, shape: tuple[int, int]) -> str | None:
    """The reason why data are no JPEG of this size, as far as their header tells.

    Checked before they are decoded: a header that claims 65 535 lines costs gigabytes.
    """
    if not data.size:
        return "it is empty"
    if data[: len(_SOI)].tobytes() != _SOI:
        return "it does not begin like one"
    if header is None:
        return "its header breaks off"
    if header.shape != shape:
        return f"it has {header.shape[1]}×{header.shape[0]} pixels, not {shape[1]}×{shape[0]}"
    return None


def _header(data: bytes) -> Header | None:
    """The segments before the scan; None if they do not tell the size, or there is no scan."""
    at, header, restart_units = len(_SOI), None, 0
    while at + 4 <= len(data) and data[at] == _FILL:
        marker, body = data[at + 1], data[at + 4 : at + 4 + _MOST_BODY]
        if marker == _SOS:
            return header and header._replace(restart_units=restart_units)
        if marker in _FRAMES and len(body) == _MOST_BODY:
            header = _frame(body)
        if marker == _RESTARTS:
            restart_units = int.from_bytes(body[:2], "big")
        # A marker may have any number of filling bytes before it.
        at += 1 if marker == _FILL else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None


def _frame(body: bytes) -> Header:
    """Size of a frame and of its units, which have more blocks of luma each way where colours are coarser."""
    lines, columns, colours, sampling = (
        int.from_bytes(body[1:3], "big"),
        int.from_bytes(body[3:5], "big"),
        body[5],
        body[7],
    )
    across, down = (sampling >> 4, sampling & 15) if colours > 1 else (1, 1)
    return Header((lines, columns), (_BLOCK * max(down, 1), _BLOCK * max(across, 1)), 0)
