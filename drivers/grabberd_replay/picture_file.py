"""Untrusted picture files: PNG, JPEG, TIFF, BMP and PGM. Each is read whole or refused by name.

Grey values come as they are stored: a JPEG's luma as it was coded, no gamma, and no turning by an orientation
mark.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from grabberd.core.field import LARGEST_SIDE_PX
from grabberd.errors import PictureError
from grabberd_replay.decoder import FROM_COLOURS, Samples, from_colours

_STRIPS, _TILES = (273, 279), (324, 325)
"""Tags with the places of parts of a picture and with their sizes in bytes."""
_SIZES = {3: ("H", 2), 4: ("I", 4), 16: ("Q", 8)}
_MOST_PAGES, _MOST_PARTS = 1000, 1 << 20


class TiffFault(Exception):
    """The directories are damaged, or lead beyond the end of the file."""


def pages(data: bytes) -> int:
    """Number of pages, all of whose bytes are in the file.

    Raises:
        TiffFault: some are not.
    """
    try:
        return sum(1 for _ in _directories(data))
    except (struct.error, KeyError) as error:
        raise TiffFault from error


def _directories(data: bytes) -> Iterator[int]:
    order = "<" if data[:2] == b"II" else ">"
    big = struct.unpack_from(order + "H", data, 2)[0] == 43
    counts, entry, places = ("Q", 20, "Q") if big else ("H", 12, "I")
    (at,) = struct.unpack_from(order + places, data, 8 if big else 4)
    for _ in range(_MOST_PAGES):
        if not at:
            return
        (count,) = struct.unpack_from(order + counts, data, at)
        first = at + struct.calcsize(counts)
        if not 0 < count <= _MOST_PARTS or first + count * entry + struct.calcsize(places) > len(data):
            raise TiffFault
        tags = dict(_values(data, order, first + k * entry, places) for k in range(count))
        for offsets, sizes in (_STRIPS, _TILES):
            for offset, size in zip(tags.get(offsets, ()), tags.get(sizes, ()), strict=True):
                if offset + size > len(data):
                    raise TiffFault
        yield at
        (at,) = struct.unpack_from(order + places, data, first + count * entry)


def _values(data: bytes, order: str, at: int, places: str) -> tuple[int, tuple[int, ...]]:
    """Tag and values of an entry, where these are places or sizes."""
    tag, kind = struct.unpack_from(order + "HH", data, at)
    if tag not in _STRIPS + _TILES:
        return tag, ()
    (count,) = struct.unpack_from(order + places, data, at + 4)
    letter, size = _SIZES[kind]
    inline = struct.calcsize(places)
    if count > _MOST_PARTS:
        raise TiffFault
    place = at + 4 + inline
    if count * size > inline:
        (place,) = struct.unpack_from(order + places, data, place)
    return tag, struct.unpack_from(f"{order}{count}{letter}", data, place)


SUFFIXES = {
    ".png": "PNG",
    **dict.fromkeys((".jpg", ".jpeg"), "JPEG"),
    **dict.fromkeys((".tif", ".tiff"), "TIFF"),
    ".bmp": "BMP",
    **dict.fromkeys((".pgm", ".ppm", ".pnm"), "PGM"),
}
_HEADS = {
    "JPEG": (b"\xff\xd8\xff",),
    "TIFF": (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
    "BMP": (b"BM",),
    "PGM": (b"P2", b"P3", b"P5", b"P6"),
}

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _WITH_ALPHA = (0, 4), (4, 6)
"""Colour types of the header."""
_COLOUR_TYPE = 25
"""Byte of the colour type in a file."""
_BITS = 8
"""Bits of a sample of most pictures, and of all that are measured."""
_COLOURS = 3
_AFTER_JPEG = 1 << 16
"""Bytes that may follow a JPEG's end: cameras append what they like."""
_AGAIN = "copy or export it again; what came before it is kept"
LARGEST_BYTES = 64 << 20
"""Size of a file: all pixels of the largest picture in four uncompressed colours."""


class Header(NamedTuple):
    """Properties that all pictures of a recording share.

    Attributes:
        lines, columns: size of the picture.
        coloured: true if grey has to be computed from colours.
        bits: 16 if a sample is stored in so many bits, else 8.
    """

    lines: int
    columns: int
    coloured: bool
    bits: int = 8

    @property
    def details(self) -> dict[str, str]:
        """Stream detail for pictures whose grey values were computed from colours."""
        return {"colours": FROM_COLOURS} if self.coloured else {}

    def __str__(self) -> str:
        deep = "" if self.bits == _BITS else f" of {self.bits} bits"
        return f"{self.columns}x{self.lines} {'coloured' if self.coloured else 'grey'}{deep}"


def read_picture(path: Path, expected: Header | None = None) -> tuple[Header, Samples]:
    """Header and grey values of a picture; colours become luma by Rec. 601, as in a grabber.

    Values are as they stand in the file, of 8 or of 16 bits: `Levels` scales the latter.

    Args:
        path: path of the picture.
        expected: header that the picture should have.

    Raises:
        PictureError: the picture is missing, of another kind than its name says, truncated, damaged, has
            transparent pixels or several pages, or differs from `expected`.
    """
    data = _bytes(path, expected)
    kind = SUFFIXES.get(path.suffix.lower(), "PNG")
    header, picture = (_png if kind == "PNG" else _other)(path, kind, data, expected)
    if expected is not None and header != expected:
        raise PictureError(
            f"{path} is {header}, expected {expected} like the first picture",
            "leave it out or give it the size, colours and bits of the others; what came before it is kept",
        )
    return header, from_colours(picture) if picture.ndim > 2 else picture


def _png(path: Path, _kind: str, data: bytes, expected: Header | None) -> tuple[Header, Samples]:
    header = _header(path, data, expected)
    _check_chunks(path, data, header)
    if expected is not None and header != expected:
        return header, np.empty((0, 0), np.uint8)  # refused, and not decoded first
    if data[_COLOUR_TYPE] in _WITH_ALPHA:
        _check_opaque(path, data)
    mode = cv2.IMREAD_COLOR if header.coloured else cv2.IMREAD_GRAYSCALE
    picture = _decoded(data, mode | (cv2.IMREAD_ANYDEPTH if header.bits > _BITS else 0))
    if picture is None or picture.shape[:2] != (header.lines, header.columns):
        raise _damaged(path, header, "its content cannot be decoded")
    return header, picture


def _other(path: Path, kind: str, data: bytes, expected: Header | None) -> tuple[Header, Samples]:
    what = f"{expected} as " if expected else ""
    if not data.startswith(_HEADS[kind]):
        raise PictureError(
            f"{path} is no {kind} ({len(data)} bytes), expected {what}{kind}", f"export it as {kind} or PNG"
        )
    # A decoder silently fills up what is truncated.
    if kind == "JPEG" and b"\xff\xd9" not in data[-_AFTER_JPEG:]:
        raise PictureError(f"{path} is truncated after {len(data)} bytes, expected {what}JPEG", _AGAIN)
    if kind == "BMP" and len(data) < int.from_bytes(data[2:6], "little"):
        raise PictureError(f"{path} is truncated after {len(data)} bytes, expected {what}BMP", _AGAIN)
    if kind == "TIFF":
        _check_pages(path, data, what)
    # The luma of a JPEG is its own; what other kinds have in place of grey is looked at as it is.
    picture = _decoded(data, cv2.IMREAD_GRAYSCALE if kind == "JPEG" else cv2.IMREAD_UNCHANGED)
    if picture is None or not picture.size or max(picture.shape[:2]) > LARGEST_SIDE_PX:
        raise PictureError(
            f"{path} cannot be decoded, or has more than {LARGEST_SIDE_PX} pixels each way, expected "
            f"{what}{kind}",
            _AGAIN,
        )
    if picture.dtype not in (np.uint8, np.uint16):
        raise PictureError(
            f"{path} has samples of {picture.dtype}, expected whole numbers of 8 or 16 bits",
            "export it as PNG",
        )
    if picture.ndim > 2 and picture.shape[2] > _COLOURS:
        _check_alpha(path, picture)
        picture = picture[..., :_COLOURS]
    lines, columns = picture.shape[:2]
    return Header(lines, columns, picture.ndim > 2, 8 * picture.itemsize), picture


def _check_pages(path: Path, data: bytes, what: str) -> None:
    try:
        count = pages(data)
    except TiffFault as error:
        raise PictureError(
            f"{path} is truncated or damaged ({len(data)} bytes), expected {what}TIFF", _AGAIN
        ) from error
    if count > 1:
        raise PictureError(f"{path} has {count} pages, expected one picture in a file", "export them singly")


def _decoded(data: bytes, mode: int) -> Samples | None:
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), mode | cv2.IMREAD_IGNORE_ORIENTATION)  # type: ignore[return-value]
    except cv2.error:
        return None


def _check_opaque(path: Path, data: bytes) -> None:
    """Refuses a picture whose alpha channel hides something: what lies beneath is not what was seen."""
    picture = _decoded(data, cv2.IMREAD_UNCHANGED)
    if picture is not None and picture.ndim > 2:
        _check_alpha(path, picture)


def _check_alpha(path: Path, picture: Samples) -> None:
    opaque = (1 << 8 * picture.itemsize) - 1
    if hidden := int((picture[..., -1] < opaque).sum()):
        raise PictureError(
            f"{path} has an alpha channel with {hidden} transparent pixels, expected opaque ones alone",
            "export it without transparency",
        )


def _bytes(path: Path, expected: Header | None) -> bytes:
    what = f"; expected {expected}" if expected else ""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except FileNotFoundError as error:
        hint = "put it back; what came before it is kept"
        raise PictureError(f"{path} is missing{what}", hint) from error
    except OSError as error:
        hint = "correct the file's permissions"
        raise PictureError(f"{path} cannot be read: {error.strerror}{what}", hint) from error
    if len(data) > LARGEST_BYTES:
        hint = "leave it out, or export it as grey PNG"
        raise PictureError(f"{path} has more than {LARGEST_BYTES} bytes{what}", hint)
    return data


def _header(path: Path, data: bytes, expected: Header | None) -> Header:
    if data[:8] != _SIGNATURE or len(data) < 33:
        what = f"{expected} as " if expected else ""
        kind = "truncated in its head" if _SIGNATURE.startswith(data[:8]) else "no PNG"
        hint = "copy it again, or export it as PNG"
        raise PictureError(f"{path} is {kind} ({len(data)} bytes), expected {what}PNG", hint)
    columns, lines, depth, colour = struct.unpack(">IIBB", data[16:26])
    if not (0 < lines <= LARGEST_SIDE_PX and 0 < columns <= LARGEST_SIDE_PX):
        raise PictureError(
            f"{path} has {columns}x{lines} pixels by its header, expected at most {LARGEST_SIDE_PX} each way",
            "leave it out, or export it at the size that the grabber gave",
        )
    return Header(lines, columns, colour not in _GREY, max(_BITS, depth))


def _check_chunks(path: Path, data: bytes, header: Header) -> None:
    """Walks the chunks to the last one, since a decoder silently fills up a truncated picture."""
    at = 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        end = at + 12 + length
        if end > len(data):
            break
        if zlib.crc32(data[at + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise _damaged(path, header, f"the checksum at byte {end - 4} is wrong")
        if data[at + 4 : at + 8] == b"IEND":
            return
        at = end
    raise _damaged(path, header, f"it is truncated after {len(data)} bytes")


def _damaged(path: Path, header: Header, why: str) -> PictureError:
    return PictureError(f"{path}: {why}; expected a whole picture of {header}", "copy or export it again")
