"""Serial ports as files: opened for one program alone, in raw mode, with errors that say what to do."""

import errno
import fcntl
import os
import termios
from pathlib import Path
from typing import Any

from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused

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
