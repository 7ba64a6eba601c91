"""Video standards, and extraction of the luma from a buffer for each pixel format, including JPEG.

A broken JPEG is reported as damage and never ends the stream.

Sizes, pixel formats and rates that a camera without a video standard offers, and the choice among them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from grabberd.core.field import BOTTOM, LARGEST_SIDE_PX, NTSC_HZ, PAL_HZ, PROGRESSIVE, TOP
from grabberd_v4l2 import abi
from grabberd_v4l2.node import Node

Size = tuple[int, int]
"""Pixels per line, and lines."""

LEAST_HZ, MOST_HZ = 5, 1000
"""Rates that are taken: slower streams look like a grabber that has stopped, faster ones are no camera's."""
ENOUGH_HZ = 25
"""Rate below which a mode is chosen only if requested, or if there is no faster one."""
_NEAR = 2e-3
"""Relative tolerance of a requested rate: 59.94 is accepted as 60."""
_MOST_IN_WORDS = 24
_SQUARE = (640, 480)


class Mode(NamedTuple):
    """A size in a pixel format.

    Attributes:
        fourcc: Pixel format.
        columns, lines: Size.
        rates_hz: Pictures per second, the highest first; empty if the camera does not report them.
    """

    fourcc: str
    columns: int
    lines: int
    rates_hz: tuple[Fraction, ...]

    @property
    def size(self) -> Size:
        """Pixels per line, and lines."""
        return self.columns, self.lines


class Wish(NamedTuple):
    """A stream that may be requested.

    Attributes:
        mode: Size and format.
        rate_hz: Pictures per second; None leaves it to the camera.
    """

    mode: Mode
    rate_hz: Fraction | None


def offered(
    node: Node, formats: Iterable[str], size: Size | None = None, rate_hz: float | None = None
) -> Iterator[Mode]:
    """All modes with these formats.

    If the camera reports a range, `size` and `rate_hz` are used if they are within it, otherwise the largest.
    """
    for fourcc in formats:
        sizes = [_size_of(one, size) for one in node.frame_sizes(fourcc)] or [size or _SQUARE]
        for columns, lines in sizes:
            intervals = node.frame_intervals(fourcc, columns, lines)
            rates = {rate for one in intervals for rate in _rates_of(one, rate_hz)}
            yield Mode(fourcc, columns, lines, tuple(sorted(rates, reverse=True)))


def wishes(
    modes: Iterable[Mode], ranks: Mapping[str, int], size: Size | None, rate_hz: float | None
) -> list[Wish]:
    """The streams to request, the best first.

    They are sorted by whether the rate reaches `ENOUGH_HZ`, then by the format's rank, the size and the rate.

    Args:
        modes: Modes that the camera offers.
        ranks: Allowed formats with their rank; the lowest is the best.
        size: The only size, or None for any.
        rate_hz: The only rate, or None for any from `LEAST_HZ` to `MOST_HZ`.
    """
    found = [
        Wish(mode, rate)
        for mode in modes
        if mode.fourcc in ranks and size in (None, mode.size) and _can_be_read(mode.size)
        for rate in _wanted(mode.rates_hz, rate_hz)
    ]
    return sorted(found, key=lambda wish: _order(wish, ranks), reverse=True)


def is_near(rate_hz: float | Fraction, wanted_hz: float | Fraction) -> bool:
    """True if a rate is the requested one within the tolerance."""
    return abs(float(rate_hz) / float(wanted_hz) - 1) <= _NEAR


def in_words(modes: Sequence[Mode]) -> str:
    """The modes as a list, e.g. "YUYV 640×480 at 30, 15; MJPG 1280×720 at 60"."""
    words = [f"{mode.fourcc} {mode.columns}×{mode.lines}{_rates_in_words(mode)}" for mode in modes]
    more = f"; and {len(words) - _MOST_IN_WORDS} more" if len(words) > _MOST_IN_WORDS else ""
    return ("; ".join(words[:_MOST_IN_WORDS]) + more) or "nothing"


def _size_of(entry: abi.FrmSizeEnum, wanted: Size | None) -> Size:
    if entry.type == abi.FRMSIZE_TYPE_DISCRETE:
        return int(entry.discrete.width), int(entry.discrete.height)
    span = entry.stepwise
    if wanted is not None:
        columns, lines = wanted
        fits = (
            span.min_width <= columns <= span.max_width
            and span.min_height <= lines <= span.max_height
            and not (columns - span.min_width) % max(span.step_width, 1)
            and not (lines - span.min_height) % max(span.step_height, 1)
        )
        if fits:
            return wanted
    return int(span.max_width), int(span.max_height)


def _rates_of(entry: abi.FrmIvalEnum, wanted_hz: float | None) -> Iterator[Fraction]:
    if entry.type == abi.FRMIVAL_TYPE_DISCRETE:
        yield from _rate(entry.discrete)
        return
    span = entry.stepwise
    for most in _rate(span.min):
        least = next(_rate(span.max), Fraction(0))
        if wanted_hz is not None and least <= wanted_hz <= most:
            yield Fraction(wanted_hz).limit_denominator(1001)
        else:
            yield most


def _rate(interval: abi.Fraction) -> Iterator[Fraction]:
    """The rate of an interval; nothing if the driver fills it with zeros."""
    if interval.numerator and interval.denominator:
        yield Fraction(interval.denominator, interval.numerator)


def _can_be_read(size: Size) -> bool:
    columns, lines = size
    return not lines % 2 and 0 < columns <= LARGEST_SIDE_PX and 0 < lines <= LARGEST_SIDE_PX


def _wanted(rates_hz: Sequence[Fraction], rate_hz: float | None) -> Iterator[Fraction | None]:
    if not rates_hz:
        yield None if rate_hz is None else Fraction(rate_hz).limit_denominator(1001)
    for one in rates_hz:
        if LEAST_HZ <= one <= MOST_HZ if rate_hz is None else is_near(one, rate_hz):
            yield one


def _order(wish: Wish, ranks: Mapping[str, int]) -> tuple[bool, int, int, Fraction, int]:
    mode, rate_hz = wish.mode, wish.rate_hz or Fraction(0)
    is_enough = wish.rate_hz is None or rate_hz >= ENOUGH_HZ
    preferred = -list(ranks).index(mode.fourcc)
    return is_enough, -ranks[mode.fourcc], mode.columns * mode.lines, rate_hz, preferred


def _rates_in_words(mode: Mode) -> str:
    rates = ", ".join(f"{float(rate):.4g}" for rate in mode.rates_hz)
    return f" at {rates}" if rates else ""


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


DEFAULT = "PAL"
NAMES = {
    "PAL": abi.STD_PAL,
    "PAL-BG": 0x07,
    "PAL-B": 0x01,
    "PAL-B1": 0x02,
    "PAL-G": 0x04,
    "PAL-H": 0x08,
    "PAL-I": 0x10,
    "PAL-DK": 0xE0,
    "PAL-D": 0x20,
    "PAL-D1": 0x40,
    "PAL-K": 0x80,
    "PAL-N": 0x0200,
    "PAL-NC": 0x0400,
    "SECAM": 0xFF0000,
    "NTSC": 0xB000,
    "NTSC-M": 0x1000,
    "NTSC-M-JP": 0x2000,
    "NTSC-M-KR": 0x8000,
    "NTSC-443": 0x4000,
    "PAL-M": 0x0100,
    "PAL-60": 0x0800,
}
"""Standards that can be requested; for "PAL" the card chooses one of B to K, for "NTSC" an M type."""


class Scan(NamedTuple):
    """Lines and rate of a camera's scan, and the order of its fields.

    Attributes:
        lines: Lines of a frame, or of a progressive picture.
        rate_hz: Fields or progressive pictures per second.
        older: Parity of the older field of a frame, as defined by V4L2 for the standard, or `PROGRESSIVE`.
    """

    lines: int
    rate_hz: float
    older: int

    @classmethod
    def progressive(cls, lines: int, rate_hz: float) -> "Scan":
        """The scan of progressive pictures."""
        return cls(lines, rate_hz, PROGRESSIVE)

    @property
    def is_progressive(self) -> bool:
        """True for pictures without fields."""
        return self.older == PROGRESSIVE

    @property
    def period_ns(self) -> int:
        """Time from field to field, or from picture to picture."""
        return round(1e9 / self.rate_hz)

    def __str__(self) -> str:
        return f"{self.rate_hz:.0f} Hz"


SCAN_625 = Scan(576, PAL_HZ, TOP)
SCAN_525 = Scan(480, NTSC_HZ, BOTTOM)


def bits(name: str) -> int:
    """The kernel's bits of a standard; "PAL-B/G" is "PAL-BG".

    Raises:
        ValueError: The name is not in `NAMES`.
    """
    known = NAMES.get(name.upper().replace("/", ""))
    if known is None:
        raise ValueError(f"{name!r} is not one of {', '.join(NAMES)}")
    return known


def name(standard: int) -> str:
    """Name of a set of standard bits."""
    exact = next((known for known, its in NAMES.items() if its == standard), None)
    return exact or next((known for known, its in NAMES.items() if its & standard), "none")


def scan(standard: int) -> Scan | None:
    """The scan of a set of standard bits; None if it is empty or has both rates."""
    at_50, at_60 = bool(standard & abi.STD_625_50), bool(standard & abi.STD_525_60)
    if at_50 == at_60:
        return None
    return SCAN_625 if at_50 else SCAN_525


def family(scanned: Scan) -> str:
    """The common name of a scan, as used in the option `standard`."""
    return "PAL" if scanned == SCAN_625 else "NTSC"
