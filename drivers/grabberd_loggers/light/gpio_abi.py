"""The kernel's character device of GPIO lines, version 2: its structures and requests (linux/gpio.h)."""

import fcntl
import os
import struct
from typing import NamedTuple

NAME_BYTES = 32
LINES_MAX = 64
USED, ACTIVE_LOW, OUTPUT = 1 << 0, 1 << 1, 1 << 3

_CHIP_INFO = struct.Struct("32s32sI")
_LINE_INFO = struct.Struct("32s32sIIQ160s16x")
_CONFIG = struct.Struct("QI20x240s")
_REQUEST = struct.Struct(f"{LINES_MAX * 4}s32s{_CONFIG.size}sII20xi")
_VALUES = struct.Struct("QQ")
_OUTPUT_VALUES = struct.Struct("II QQ")
_OUTPUT_VALUES_ID = 2


def _number(direction: int, code: int, size: int) -> int:
    return direction << 30 | size << 16 | 0xB4 << 8 | code


_READ, _BOTH = 2, 3
GET_CHIP_INFO = _number(_READ, 0x01, _CHIP_INFO.size)
GET_LINE_INFO = _number(_BOTH, 0x05, _LINE_INFO.size)
GET_LINE = _number(_BOTH, 0x07, _REQUEST.size)
GET_VALUES = _number(_BOTH, 0x0E, _VALUES.size)
SET_VALUES = _number(_BOTH, 0x0F, _VALUES.size)


class ChipInfo(NamedTuple):
    """A chip: its name, its label, and how many lines it has."""

    name: str
    label: str
    lines: int


class LineInfo(NamedTuple):
    """A line: its name, who uses it, and its flags."""

    name: str
    consumer: str
    flags: int


class GpioKernel:
    """The requests to the kernel; each raises OSError as the kernel refuses."""

    def chip_info(self, chip: int) -> ChipInfo:
        """Information on a chip, by its descriptor."""
        answer = fcntl.ioctl(chip, GET_CHIP_INFO, bytes(_CHIP_INFO.size))
        name, label, lines = _CHIP_INFO.unpack(answer)
        return ChipInfo(_text(name), _text(label), lines)

    def line_info(self, chip: int, offset: int) -> LineInfo:
        """Information on a line of a chip."""
        asked = _LINE_INFO.pack(b"", b"", offset, 0, 0, b"")
        name, consumer, _, _, flags, _ = _LINE_INFO.unpack(fcntl.ioctl(chip, GET_LINE_INFO, asked))
        return LineInfo(_text(name), _text(consumer), flags)

    def take_output(self, chip: int, offset: int, consumer: str, inverted: bool) -> int:
        """Descriptor of a line that is now an output, off, and nobody else's."""
        answer = fcntl.ioctl(chip, GET_LINE, output_request(offset, consumer, inverted))
        descriptor: int = _REQUEST.unpack(answer)[-1]
        return descriptor

    def set_value(self, line: int, on: bool) -> None:
        """Switch a line that was taken."""
        fcntl.ioctl(line, SET_VALUES, _VALUES.pack(int(on), 1))

    def value(self, line: int) -> bool:
        """State of a line that was taken."""
        bits, _ = _VALUES.unpack(fcntl.ioctl(line, GET_VALUES, _VALUES.pack(0, 1)))
        return bool(bits & 1)

    def open(self, path: str) -> int:
        """Descriptor of a chip."""
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)

    def close(self, descriptor: int) -> None:
        """Close a chip or a line."""
        os.close(descriptor)


def output_request(offset: int, consumer: str, inverted: bool) -> bytes:
    """The request for a line that becomes an output and is off."""
    off = _OUTPUT_VALUES.pack(_OUTPUT_VALUES_ID, 0, 0, 1)
    config = _CONFIG.pack(OUTPUT | (ACTIVE_LOW if inverted else 0), 1, off)
    offsets = struct.pack("I", offset)
    return _REQUEST.pack(offsets, consumer.encode()[: NAME_BYTES - 1], config, 1, 0, 0)


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode(errors="replace")
