"""Serial ports, opened for one program alone, in raw mode, with errors that say what to do; lines of text
from them: a microcontroller, a bench logger or an adapter on a serial port or USB.
"""

import errno
import fcntl
import os
import re
import select
import stat
import struct
import termios
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.runtime import Clock
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.options import LineOptions, Options

_BYTES = 65_536
_SIZE = {7: termios.CS7, 8: termios.CS8}
_PARITY = {"none": 0, "even": termios.PARENB, "odd": termios.PARENB | termios.PARODD}
_STOP = {1: 0, 2: termios.CSTOPB}
_SPEED_SHARE = 0.02
"""Difference of two speeds at which the middle of a character's last bit is still that bit."""


class PortSettings(Options):
    """Speed of a port, and the bits of its characters.

    Attributes:
        baud: its speed.
        bits: bits of a character; `parity`: its parity bit; `stop_bits`: those at its end.
    """

    baud: int = Field(9600, ge=50, lt=1 << 32)
    bits: Literal[7, 8] = 8
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1

    @property
    def control(self) -> int:
        """Size, parity and stop bits, as termios has them."""
        return _SIZE[self.bits] | _PARITY[self.parity] | _STOP[self.stop_bits]

    def refused(self, baud: int, control: int) -> str:
        """Names what a port does otherwise, by the speed and control bits that it has; empty for nothing."""
        other = control ^ self.control
        refused = [
            (other & termios.CSIZE, f"{self.bits} data bits"),
            (other & _PARITY["odd"], "no parity" if self.parity == "none" else f"{self.parity} parity"),
            (other & termios.CSTOPB, f"{self.stop_bits} stop bit" + "s" * (self.stop_bits > 1)),
            (abs(baud - self.baud) > _SPEED_SHARE * self.baud, f"{self.baud} baud (it gives {baud})"),
        ]
        return " and ".join(words for is_other, words in refused if is_other)


class SerialOptions(PortSettings, LineOptions):
    """All options, those of the port among them.

    Attributes:
        port: the port, preferably a link in /dev/serial/by-id, which stays the same.
        start: text that is sent once it is open, for loggers that wait to be asked.
    """

    port: Path
    baud: int = Field(115_200, ge=50, lt=1 << 32)
    start: str = ""


class _Port:
    """A serial port in raw mode."""

    driver = "serial"
    begins_anywhere = True

    def __init__(self, options: SerialOptions, _clock: Clock) -> None:
        self._options = options
        self._file: int | None = None

    def open(self) -> Opened:
        options = self._options
        port = options.port
        self._file = open_port(port, options)
        try:
            os.write(self._file, options.start.encode())
        except OSError as error:
            raise StreamFailed(f"{port} does not take the text to start: {error.strerror}", PLUG) from error
        details = {"port": str(port), "device": str(port.resolve()), "baud": str(options.baud)}
        return Opened(port.name, details)

    def receive(self, timeout_s: float) -> Received:
        assert self._file is not None
        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        if not poll.poll(timeout_s * 1000):
            return Received()
        try:
            data = os.read(self._file, _BYTES)
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


def open_port(port: Path, settings: PortSettings) -> int:
    """Descriptor of a port, which no other program can open any more.

    Args:
        port: Its path.
        settings: How characters are sent over it.

    Raises:
        DeviceAbsent: There is no such port.
        DeviceRefused: It may not be opened, another program has it, it is no serial port, or does not do what
            it is set to.
    """
    try:
        if not stat.S_ISCHR(mode := port.stat().st_mode):
            raise DeviceRefused(f"{port} is {_KINDS[stat.S_IFMT(mode)]}, not a serial port", _NAME_ONE)
        file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise _not_opened(port, error) from error
    try:
        _claim(file)  # before anything is set: the program that has the port would read nonsense from then on
        _set_up(file, settings)
        if refused := settings.refused(_speed(file), termios.tcgetattr(file)[2]):
            raise DeviceRefused(f"{port} refuses {refused}", _OTHER_SETTINGS)
    except BaseException as error:
        os.close(file)
        if isinstance(error, OSError | termios.error):
            raise _not_opened(port, OSError(*error.args)) from error
        raise
    return file


def lost(port: Path) -> DeviceLost:
    """The error for a port that went away."""
    return DeviceLost(f"{port} is gone", "plug it in again; grabberd retries automatically")


_TERMIOS2 = struct.Struct("4IB19s2I")
"""The kernel's own structure: four words of modes, the third for control, line, characters, two speeds."""
_TCGETS2, _TCSETS2 = 0x802C542A, 0x402C542B
_CBAUD, _BOTHER = 0o10017, 0o10000
_NAMED = re.compile(r"B\d+")


def _set_up(file: int, settings: PortSettings) -> None:
    """Raw characters; without hardware flow control, which would switch RTS by itself."""
    characters = list(termios.tcgetattr(file)[6])
    characters[termios.VMIN], characters[termios.VTIME] = 0, 0
    control = settings.control | termios.CREAD | termios.CLOCAL
    is_named = hasattr(termios, f"B{settings.baud}")
    speed = getattr(termios, f"B{settings.baud}", termios.B9600)
    raw: list[Any] = [0, 0, control, 0, speed, speed, characters]
    # What is refused is an error, or silently not done: the settings are read back in either case.
    with suppress(termios.error):
        termios.tcsetattr(file, termios.TCSANOW, raw)
    if not is_named:
        with suppress(OSError):
            words = _modes(file)
            words[2] = words[2] & ~_CBAUD | _BOTHER
            words[-2:] = settings.baud, settings.baud
            fcntl.ioctl(file, _TCSETS2, _TERMIOS2.pack(*words))


def _modes(file: int) -> list[Any]:
    return list(_TERMIOS2.unpack(fcntl.ioctl(file, _TCGETS2, bytes(_TERMIOS2.size))))


def _speed(file: int) -> int:
    """Speed that the port has, which may be another than it was asked for."""
    try:
        return int(_modes(file)[-1])
    except OSError:  # of the architectures that have no such structure, and named speeds alone
        named = {getattr(termios, name): int(name[1:]) for name in filter(_NAMED.fullmatch, dir(termios))}
        return named[termios.tcgetattr(file)[5]]


def _claim(file: int) -> None:
    """Keep other programs from the port: two readers would each get half of the lines."""
    fcntl.ioctl(file, termios.TIOCEXCL)
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


_NAME_ONE = "'grabberd devices' lists the serial ports"
_OTHER_SETTINGS = (
    "set baud, bits, parity and stop_bits to what port and logger both do, or use another adapter"
)
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFREG: "a file",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFBLK: "a disk",
}


_RIGHTS = {
    errno.EPERM: "under systemd, install the drop-in loggers.conf, which lets the daemon use serial ports",
    errno.EACCES: "add grabberd's user to the group that owns it, usually dialout, and log in again",
}


def _not_opened(port: Path, error: OSError) -> DeviceAbsent | DeviceRefused:
    if error.errno in (errno.EBUSY, errno.EWOULDBLOCK):
        return DeviceRefused(f"another program has {port}", "end it", Cause.DEVICE_BUSY)
    if error.errno == errno.ENOTTY:
        return DeviceRefused(f"{port} is a device, but not a serial port", _NAME_ONE)
    if error.errno in _RIGHTS:
        why = f"{port} may not be opened: {error.strerror}"
        return DeviceRefused(why, _RIGHTS[error.errno], Cause.NO_RIGHTS)
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO, errno.ENOTDIR):
        return DeviceAbsent(f"there is no {port}", PLUG)
    return DeviceRefused(f"{port} cannot be opened: {error.strerror}", _NAME_ONE)
