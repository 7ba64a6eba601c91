"""Extraction of the luma from a buffer, for each pixel format, including JPEG.

A broken JPEG is reported as damage and never ends the stream.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray


class PixelFormat(NamedTuple):
    """Memory layout of a pixel format.

    Attributes:
        word: Type of one pixel; its low byte is the luma, its high byte, if any, chroma.
        planes: Size of the whole picture in units of its luma plane.
        is_compressed: True for JPEG; the layout is that of the decoded luma.
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
"""The supported formats in order of preference.

The first four have the same 8-bit luma, so they are ordered by cost: GREY carries nothing else, NV12 half as
much again, YUYV and UYVY twice as much, and their luma must be extracted, which takes longer for UYVY. JPEG
must be decoded, and its luma is not exactly the camera's; only digital cameras deliver it.
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
    """Grey values of selected lines, with contiguous pixels.

    The result is a view into the buffer if its pixels are contiguous (GREY, NV12), otherwise a copy without
    the chroma: the copy takes a fifth of the extra time that doubling lines of strided pixels would take.

    Args:
        buffer: (n,) uint8, at least `needed_bytes`.
        fourcc: One of `FORMATS`.
        lines: Lines of the picture.
        columns: Pixels per line.
        bytes_per_line: Distance of two lines in bytes.
        rows: The lines to extract.

    Returns:
        (rows, columns) uint8.

    Raises:
        ValueError: The buffer is too short.
    """
    used = columns * bytes_per_pixel(fourcc)
    length = (lines - 1) * bytes_per_line + used
    if buffer.size < length:
        raise ValueError(f"{lines} lines of {fourcc} need {length} bytes, the buffer has {buffer.size}")
    # Not a reshape, because the last line need not be padded.
    picture = np.ndarray((lines, used), np.uint8, buffer, strides=(bytes_per_line, 1))
    return picture[rows].view(FORMATS[fourcc].word).astype(np.uint8, copy=False)


def bytes_per_pixel(fourcc: str) -> int:
    """Bytes per pixel in the plane that contains the luma."""
    return np.dtype(FORMATS[fourcc].word).itemsize


def needed_bytes(fourcc: str, lines: int, columns: int, bytes_per_line: int) -> int:
    """Bytes of a complete picture, including chroma; a buffer with fewer bytes is truncated."""
    padding = bytes_per_line - columns * bytes_per_pixel(fourcc)
    return int(lines * FORMATS[fourcc].planes) * bytes_per_line - padding


_SOI, _EOI = b"\xff\xd8", b"\xff\xd9"
_FILL, _SOS, _RESTARTS = 0xFF, 0xDA, 0xDD
_FRAMES = (0xC0, 0xC1, 0xC2)
"""Markers with the picture's size: baseline, extended and progressive Huffman coding."""
_MOST_HEADER = 65_536
_MOST_BODY = 8
"""Number of bytes read of a segment."""
_BLOCK = 8
_NOTHING_LEFT = 128
"""Grey value of blocks for which the decoder had no data."""


class Header(NamedTuple):
    """The relevant parts of a JPEG header.

    Attributes:
        shape: Lines and columns.
        unit_px: Lines and columns of a minimum coded unit (MCU), which contains blocks of all components.
        restart_units: Restart interval in units; 0 if there are no restarts.
    """

    shape: tuple[int, int]
    unit_px: tuple[int, int]
    restart_units: int


class JpegLuma:
    """Decodes the pictures of one stream.

    Args:
        lines, columns: Size of every picture.
    """

    def __init__(self, lines: int, columns: int) -> None:
        import cv2  # noqa: PLC0415 - 16 MB, for compressed streams alone

        self._cv2 = cv2
        self._how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        self._shape = lines, columns
        self._last: NDArray[np.uint8] | None = None  # whole
        self._grey: NDArray[np.bool_] = np.zeros(0, np.bool_)

    def decode(self, data: NDArray[np.uint8]) -> tuple[NDArray[np.uint8] | None, str | None]:
        """The luma of a picture, and its damage.

        A truncated picture is grey from there on. If a picture cannot be decoded, the last intact one is
        returned, or None if there was none yet.

        Args:
            data: (n,) uint8, as the camera sent them.

        Returns:
            (lines, columns) uint8, and a description of the damage, or None.
        """
        header = _header(data[:_MOST_HEADER].tobytes())
        fault = _fault(data, header, self._shape)
        luma = None if fault else self._decoded(data)
        if luma is None or header is None or luma.shape != self._shape:
            return self._last, f"broken JPEG: {fault or 'it cannot be decoded'}"
        # The header does not reveal it: lost bytes in the middle leave too few for the last blocks.
        if self._lacks_data(_without_data(luma, header)):
            return luma, "broken JPEG: data are missing"
        self._last = luma
        return luma, None

    def _lacks_data(self, grey: NDArray[np.bool_]) -> bool:
        """True if data were missing; what looks the same in consecutive pictures is a grey scene."""
        before, self._grey = self._grey, grey
        is_new = grey & ~before if before.shape == grey.shape else np.zeros_like(grey)
        return bool(grey[-1] or is_new.any())

    def _decoded(self, data: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
        if _EOI not in data[-_MOST_HEADER:].tobytes():  # without it, the decoder would return nothing
            data = np.concatenate([data, np.frombuffer(_EOI, np.uint8)])
        try:
            return self._cv2.imdecode(data, self._how)  # type: ignore[return-value]
        except self._cv2.error:
            return None


def _without_data(luma: NDArray[np.uint8], header: Header) -> NDArray[np.bool_]:
    """Checks the last unit before each restart, and of the picture: True if it looks like missing data."""
    height, width = header.unit_px
    across = -(-luma.shape[1] // width)
    units = across * -(-luma.shape[0] // height)
    every = header.restart_units or units
    last = np.minimum(np.arange(every - 1, units + every - 1, every), units - 1)
    # The first block of a unit; the others may be outside the picture.
    lines, columns = last // across * height, last % across * width
    grey: NDArray[np.bool_] = luma[lines, columns] == _NOTHING_LEFT
    for end in np.flatnonzero(grey).tolist():
        block = luma[lines[end] : lines[end] + _BLOCK, columns[end] : columns[end] + _BLOCK]
        grey[end] = (block == _NOTHING_LEFT).all()
    return grey


def _fault(data: NDArray[np.uint8], header: Header | None, shape: tuple[int, int]) -> str | None:
    """The reason why data are not a JPEG of this size, judged by the header.

    Checked before decoding: a header that states 65 535 lines would cost gigabytes.
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
    """Parses the segments before the scan; None if the size or the scan is missing."""
    at, header, restart_units = len(_SOI), None, 0
    while at + 4 <= len(data) and data[at] == _FILL:
        marker, body = data[at + 1], data[at + 4 : at + 4 + _MOST_BODY]
        if marker == _SOS:
            return header and header._replace(restart_units=restart_units)
        if marker in _FRAMES and len(body) == _MOST_BODY:
            header = _frame(body)
        if marker == _RESTARTS:
            restart_units = int.from_bytes(body[:2], "big")
        # A marker may be preceded by any number of fill bytes.
        at += 1 if marker == _FILL else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None


def _frame(body: bytes) -> Header:
    """Size of a frame and of its units, which have several blocks of luma if the chroma is subsampled."""
    lines, columns, colours, sampling = (
        int.from_bytes(body[1:3], "big"),
        int.from_bytes(body[3:5], "big"),
        body[5],
        body[7],
    )
    across, down = (sampling >> 4, sampling & 15) if colours > 1 else (1, 1)
    return Header((lines, columns), (_BLOCK * max(down, 1), _BLOCK * max(across, 1)), 0)
