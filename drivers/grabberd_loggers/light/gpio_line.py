"""A line of a GPIO chip that a light hangs on (driver `gpio`), through the kernel's character device.

Structures and requests are those of version 2 of its interface (linux/gpio.h).
"""

import errno
import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from pydantic import Field

from grabberd.errors import Cause, DeviceAbsent, DeviceError, DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers.light.switched_light import Found, SwitchedLight
from grabberd_loggers.options import Options

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
        return _REQUEST.unpack(answer)[-1]

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


_DELAY_SIGMA_NS = 20_000
_CONSUMER = "grabberd light"
_LOOK = "list the chips and their lines with gpioinfo (package gpiod)"
_DEV = Path("/dev")
_SHOWN = 12


class GpioLightOptions(Options):
    """All options.

    Attributes:
        chip: path of the chip, as /dev/gpiochip0, or its label, which stays the same.
        line: number of the line on the chip, or its name.
        inverted: true if the light is on while the line is low.
    """

    chip: str = Field(min_length=1)
    line: int | str
    inverted: bool = False


class GpioLine:
    """The line.

    Args:
        options: See `GpioLightOptions`.
        kernel: Takes the requests.
        dev: Folder of the devices.
    """

    driver = "gpio"

    def __init__(self, options: GpioLightOptions, kernel: GpioKernel | None = None, dev: Path = _DEV) -> None:
        self._options = options
        self._kernel = kernel or GpioKernel()
        self._dev = dev
        self._line: int | None = None

    def open(self) -> Found:
        """Takes the line as an output that is off.

        Raises:
            DeviceAbsent: There is no such chip.
            DeviceRefused: It may not be opened, has no such line, or another program has it.
        """
        path, chip = self._chip()
        try:
            info = self._told(path, chip)
            number = self._number(path, chip, info)
            self._line = self._taken(path, chip, number)
        finally:
            self._kernel.close(chip)
        details = {"chip": f"{path.name} ({info.label})", "line": f"{self._options.line}"}
        return Found(f"line {self._options.line} of {info.label or path.name}", details, _DELAY_SIGMA_NS)

    def switch(self, on: bool) -> None:
        """Switches it."""
        with self._failures() as line:
            self._kernel.set_value(line, on)

    def is_on(self) -> bool:
        """The state that the chip says."""
        with self._failures() as line:
            return self._kernel.value(line)

    def close(self) -> None:
        """Switches the light off, if that is still possible, and gives the line back."""
        line = self._line
        if line is not None:
            with suppress(DeviceLost, StreamFailed):  # the chip is gone, and the light with it
                self.switch(False)
            self._line = None
            self._kernel.close(line)

    def _chip(self) -> tuple[Path, int]:
        """Path and descriptor of the chip, by its path or its label."""
        wanted = self._options.chip
        if "/" in wanted:
            return Path(wanted), self._opened(Path(wanted))
        refused: list[DeviceError] = []
        for path in sorted(self._dev.glob("gpiochip*")):
            try:
                chip = self._opened(path)
            except DeviceRefused as error:
                refused.append(error)
                continue
            if wanted in (path.name, self._label(path, chip)):
                return path, chip
            self._kernel.close(chip)
        if refused:
            raise refused[0]
        raise DeviceAbsent(f"there is no GPIO chip {wanted!r}", _LOOK)

    def _opened(self, path: Path) -> int:
        try:
            return self._kernel.open(str(path))
        except OSError as error:
            if error.errno in (errno.EACCES, errno.EPERM):
                hint = (
                    "let grabberd's user open it: light.conf under systemd, a group or a udev rule elsewhere"
                )
                raise DeviceRefused(f"{path} may not be opened", hint, Cause.NO_RIGHTS) from error
            raise DeviceAbsent(f"there is no GPIO chip {path}: {error.strerror}", _LOOK) from error

    def _told(self, path: Path, chip: int) -> ChipInfo:
        try:
            return self._kernel.chip_info(chip)
        except OSError as error:
            raise DeviceRefused(f"{path} is no GPIO chip: {error.strerror}", _LOOK) from error

    def _label(self, path: Path, chip: int) -> str | None:
        """Label of a chip among others; None if it does not say."""
        try:
            return self._told(path, chip).label
        except DeviceRefused:
            return None

    def _number(self, path: Path, chip: int, info: ChipInfo) -> int:
        wanted = self._options.line
        if isinstance(wanted, int):
            if 0 <= wanted < info.lines:
                return wanted
            raise DeviceRefused(f"{path} has no line {wanted}: its lines are 0 to {info.lines - 1}", _LOOK)
        names = [self._kernel.line_info(chip, number).name for number in range(info.lines)]
        if wanted in names:
            return names.index(wanted)
        known = [name for name in names if name]
        shown = ", ".join(known[:_SHOWN]) + (", …" if len(known) > _SHOWN else "")
        raise DeviceRefused(f"{path} has no line {wanted!r}; named are: {shown or 'none'}", _LOOK)

    def _taken(self, path: Path, chip: int, number: int) -> int:
        try:
            return self._kernel.take_output(chip, number, _CONSUMER, self._options.inverted)
        except OSError as error:
            about = self._kernel.line_info(chip, number)
            if error.errno == errno.EBUSY or about.flags & USED:
                who = about.consumer or "the kernel"
                raise DeviceRefused(
                    f"line {self._options.line} of {path} is used by {who}",
                    "end that, or use another line",
                    Cause.DEVICE_BUSY,
                ) from error
            what = f"line {self._options.line} of {path} cannot be an output: {error.strerror}"
            raise DeviceRefused(what, _LOOK) from error

    @contextmanager
    def _failures(self) -> Iterator[int]:
        """The line's descriptor, for a request that may fail."""
        if self._line is None:
            raise DeviceLost("the GPIO line is not open", "open it first")
        try:
            yield self._line
        except OSError as error:
            what = f"line {self._options.line} of {self._options.chip}"
            if error.errno in (errno.ENODEV, errno.ENXIO, errno.EBADF, errno.EIO):
                hint = "plug its chip in again; grabberd retries automatically"
                raise DeviceLost(f"{what} is gone", hint) from error
            raise StreamFailed(f"{what} does not answer: {error.strerror}", _LOOK) from error


class GpioLight(SwitchedLight):
    """A light on a line of a GPIO chip; `GpioLightOptions` lists its options."""

    options_class = GpioLightOptions
    line_class = GpioLine
