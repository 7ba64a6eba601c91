"""Untrusted PNG pictures: each is read whole or refused by name, and scaled to grey values of 8 bits.

Cameras of 10, 12 or 14 bits are usually stored in 16, either at the lower end (values up to 1023, 4095 or
16383) or at the upper one (the lowest bits are all zero). A picture itself shows which; one scale is for the
whole recording.
"""

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import LARGEST_SIDE_PX
from grabberd.errors import PictureError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _WITH_ALPHA = (0, 4), (4, 6)
"""Colour types of the header."""
_COLOUR_TYPE = 25
"""Byte of the colour type in a file."""
_BITS = 8
"""Bits of a sample of most pictures, and of all that are measured."""
LARGEST_BYTES = 64 << 20
"""Size of a file: all pixels of the largest picture in four uncompressed colours."""
Samples = NDArray[np.uint8] | NDArray[np.uint16]


class Header(NamedTuple):
    """Header of a PNG.

    Attributes:
        lines, columns: size of the picture.
        coloured: true if grey has to be computed from colours.
        bits: 16 if a sample is stored in so many bits, else 8.
    """

    lines: int
    columns: int
    coloured: bool
    bits: int = 8

    def __str__(self) -> str:
        deep = "" if self.bits == _BITS else f" of {self.bits} bits"
        return f"{self.columns}x{self.lines} {'coloured' if self.coloured else 'grey'}{deep}"


def read_png(path: Path, expected: Header | None = None) -> tuple[Header, Samples]:
    """Header and grey values of a picture; colours become luma by Rec. 601, as in a grabber.

    Values are as they stand in the file, of 8 or of 16 bits: `Levels` scales the latter.

    Args:
        path: path of the picture.
        expected: header that the picture should have.

    Raises:
        PictureError: the picture is missing, no PNG, truncated, damaged, has transparent pixels, or differs
            from `expected`.
    """
    data = _bytes(path, expected)
    header = _header(path, data, expected)
    _check_chunks(path, data, header)
    if expected is not None and header != expected:
        raise PictureError(
            f"{path} is {header}, expected {expected} like the first picture",
            "leave it out or give it the size, colours and bits of the others; what came before it is kept",
        )
    if data[_COLOUR_TYPE] in _WITH_ALPHA:
        _check_opaque(path, data)
    mode = cv2.IMREAD_COLOR if header.coloured else cv2.IMREAD_GRAYSCALE
    deep = cv2.IMREAD_ANYDEPTH if header.bits > _BITS else 0
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), mode | deep)
    if picture is None or picture.shape[:2] != (header.lines, header.columns):
        raise _damaged(path, header, "its content cannot be decoded")
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if header.coloured else picture
    return header, np.asarray(grey, np.uint16) if header.bits > _BITS else np.asarray(grey, np.uint8)


def _check_opaque(path: Path, data: bytes) -> None:
    """Refuses a picture whose alpha channel hides something: what lies beneath is not what was seen."""
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.ndim != 3:
        return
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


KNOWN_BITS = (8, 10, 12, 14, 16)
_STORED = 16
_FEWEST_ZERO = 4
"""Lowest bits that are always zero where 12 bits or fewer stand at the upper end."""


class Levels(NamedTuple):
    """Scale of a recording's samples.

    Attributes:
        bits: significant bits of a sample, which begin at its lowest one: 16 also where these are all zero.
        guessed: True if they follow from the first picture's brightest value.
    """

    bits: int
    guessed: bool = False

    @classmethod
    def of(cls, picture: NDArray[np.uint8] | NDArray[np.uint16], bits: int | None = None) -> "Levels":
        """Those of a recording with this first picture, or with so many bits."""
        if picture.dtype == np.uint8:
            return cls(8)
        if bits is not None:
            return cls(bits)
        occurring = int(np.bitwise_or.reduce(picture, axis=None))
        if occurring and occurring & -occurring >= 1 << _FEWEST_ZERO:
            return cls(_STORED)
        found = next(known for known in KNOWN_BITS if occurring < 1 << known)
        return cls(found, guessed=found < _STORED)

    def grey(self, path: Path, picture: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
        """The upper 8 bits of a picture.

        Raises:
            PictureError: it has values that so many bits cannot have.
        """
        if picture.dtype == np.uint8:
            return picture.astype(np.uint8, copy=False)
        largest, most = int(picture.max()), (1 << self.bits) - 1
        if largest > most:
            origin = ", as many as the first picture has" if self.guessed else ""
            raise PictureError(
                f"{path} has values up to {largest}, expected at most {most} of {self.bits} bits{origin}",
                f"give 'bits', one of {', '.join(map(str, KNOWN_BITS))}; what came before it is kept",
            )
        return (picture >> (self.bits - 8)).astype(np.uint8)

    @property
    def details(self) -> dict[str, str]:
        """Stream detail for pictures that were scaled."""
        return {} if self.bits == 8 else {"samples": f"the upper 8 of {self.bits} bits"}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remark on a scale that nobody stated."""
        if not self.guessed:
            return ()
        return (
            f"Its pictures are stored with 16 bits a sample; by the values in the first, {self.bits} of them "
            "are significant, of which the upper 8 are used. If the camera has others, say so with 'bits'.",
        )
