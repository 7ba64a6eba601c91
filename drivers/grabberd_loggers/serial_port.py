"""Serial ports, opened for one program alone, in raw mode, with errors that say what to do; lines of text
from them: a microcontroller, a bench logger or an adapter on a serial port or USB.
"""

import errno
import fcntl
import os
import select
import termios
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator

from grabberd.clock import Clock
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.options import LineOptions

_BYTES = 65_536
_PARITY = {"none": 0, "even": termios.PARENB, "odd": termios.PARENB | termios.PARODD}
_SIZE = {7: termios.CS7, 8: termios.CS8}
_STOP = {1: 0, 2: termios.CSTOPB}


class SerialOptions(LineOptions):
    """All options.

    Attributes:
        port: the port, preferably a link in /dev/serial/by-id, which stays the same.
        baud: its speed.
        bits: bits of a character; `parity`: its parity bit; `stop_bits`: those at its end.
        start: text that is sent once it is open, for loggers that wait to be asked.
    """

    port: Path
    baud: int = 115_200
    bits: Literal[7, 8] = 8
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1
    start: str = ""

    @field_validator("baud")
    @classmethod
    def _known_speed(cls, baud: int) -> int:
        if not hasattr(termios, f"B{baud}") or baud == 0:
            known = sorted(int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit())
            raise ValueError(f"the speeds of serial ports are {', '.join(map(str, known[1:]))}")
        return baud


class _Port:
    """A serial port in raw mode."""

    driver = "serial"
    begins_anywhere = True

    def __init__(self, options: SerialOptions, _clock: Clock) -> None:
        self._options = options
        self._file: int | None = None

    def open(self) -> Opened:
        options = self._options
        control = _SIZE[options.bits] | _PARITY[options.parity] | _STOP[options.stop_bits]
        self._file = open_port(options.port, getattr(termios, f"B{options.baud}"), control)
        if options.start:
            os.write(self._file, options.start.encode())
        port = options.port
        details = {"port": str(port), "device": str(port.resolve()), "baud": str(options.baud)}
        return Opened(port.name, details)

    def receive(self, timeout_s: float) -> Received:
        file = self._file
        if file is None:
            raise DeviceLost("the serial port is not open", "open it first")
        poll = select.poll()
        poll.register(file, select.POLLIN)
        if not poll.poll(timeout_s * 1000):
            return Received()
        try:
            data = os.read(file, _BYTES)
        except BlockingIOError:
            return Received()
        except OSError as error:
            if error.errno in GONE:
                raise lost(self._options.port) from error
            raise StreamFailed(f"{self._options.port} cannot be read: {error.strerror}", PLUG) from error
        if not data:
            raise lost(self._options.port)
        return Received(data)

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None


class SerialLogger(LineLogger):
    """A logger on a serial port; `SerialOptions` lists its options."""

    options_class = SerialOptions
    source_class = _Port


GONE = frozenset([errno.EIO, errno.ENXIO, errno.ENODEV, errno.EBADF])
"""Errors of a port that is no longer there."""
PLUG = "plug it in; 'grabberd devices' lists the serial ports"


def open_port(port: Path, speed: int = termios.B9600, control: int = termios.CS8) -> int:
    """Descriptor of a port, which no other program can open any more.

    Args:
        port: Its path.
        speed: Its speed, as termios has it.
        control: Size, parity and stop bits of its characters, as termios has them.

    Raises:
        DeviceAbsent: There is no such port.
        DeviceRefused: It may not be opened, another program has it, or it is no serial port.
    """
    try:
        file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise _not_opened(port, error) from error
    try:
        _set_up(file, speed, control)
        _claim(file)
    except termios.error as error:
        os.close(file)
        raise DeviceRefused(f"{port} is no serial port: {error.args[-1]}", PLUG) from error
    except OSError as error:
        os.close(file)
        raise _not_opened(port, error) from error
    return file


def lost(port: Path) -> DeviceLost:
    """The error for a port that went away."""
    return DeviceLost(f"{port} is gone", "plug it in again; grabberd retries automatically")


def _set_up(file: int, speed: int, control: int) -> None:
    """Raw characters; without hardware flow control, which would switch RTS by itself."""
    characters = list(termios.tcgetattr(file)[6])
    characters[termios.VMIN], characters[termios.VTIME] = 0, 0
    control |= termios.CREAD | termios.CLOCAL
    raw: list[Any] = [0, 0, control, 0, speed, speed, characters]
    termios.tcsetattr(file, termios.TCSANOW, raw)


def _claim(file: int) -> None:
    """Keep other programs from the port: two readers would each get half of the lines."""
    fcntl.ioctl(file, termios.TIOCEXCL)
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _not_opened(port: Path, error: OSError) -> DeviceAbsent | DeviceRefused:
    if error.errno in (errno.EBUSY, errno.EWOULDBLOCK):
        return DeviceRefused(f"another program has {port}", "end it", Cause.DEVICE_BUSY)
    if error.errno in (errno.EACCES, errno.EPERM):
        hint = "add grabberd's user to the group that owns it, usually dialout"
        return DeviceRefused(f"{port} may not be opened: {error.strerror}", hint, Cause.NO_RIGHTS)
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO, errno.ENOTDIR):
        return DeviceAbsent(f"there is no {port}", PLUG)
    return DeviceRefused(f"{port} cannot be opened: {error.strerror}", PLUG)
