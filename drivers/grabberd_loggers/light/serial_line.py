"""A control line of a serial port, RTS or DTR, that a light hangs on (driver `rts`)."""

import errno
import fcntl
import os
import struct
import termios
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from grabberd.errors import DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers.light.switched_light import Found, SwitchedLight
from grabberd_loggers.options import Options
from grabberd_loggers.serial_port import GONE, PLUG, PortSettings, lost, open_port

_LINES = {"rts": termios.TIOCM_RTS, "dtr": termios.TIOCM_DTR}
_DELAY_SIGMA_NS = 100_000
"""Of an adapter on USB, whose line follows the request that was confirmed."""
_WORD = struct.Struct("i")

Ioctl = Callable[[int, int, bytes], Any]


class SerialLightOptions(Options):
    """All options.

    Attributes:
        port: the port, preferably a link in /dev/serial/by-id, which stays the same. No logger can use it.
        line: control line of the port.
        inverted: true if the light is on while the line is off.
    """

    port: Path
    line: Literal["rts", "dtr"] = "rts"
    inverted: bool = False


class SerialLine:
    """The line, by the kernel's own calls.

    Args:
        options: See `SerialLightOptions`.
        ioctl: Calls the kernel; pseudo-terminals have no such lines.
    """

    driver = "rts"

    def __init__(self, options: SerialLightOptions, ioctl: Ioctl = fcntl.ioctl) -> None:
        self._options = options
        self._ioctl = ioctl
        self._file: int | None = None

    def open(self) -> Found:
        """Opens the port and switches the light off.

        Raises:
            DeviceAbsent, DeviceRefused: See `open_port`; or the port has no such lines.
        """
        options = self._options
        self._file = open_port(options.port, PortSettings())
        try:
            self.switch(False)
            self.is_on()
        except (DeviceLost, StreamFailed) as error:
            self.close()
            if isinstance(error, DeviceLost):
                raise
            raise DeviceRefused(
                f"{options.port} has no line {options.line.upper()}", "use a real serial port, or an adapter"
            ) from error
        details = {
            "port": str(options.port),
            "device": str(options.port.resolve()),
            "line": options.line.upper() + (", inverted" if options.inverted else ""),
        }
        return Found(f"{options.line.upper()} of {options.port.name}", details, _DELAY_SIGMA_NS)

    def switch(self, on: bool) -> None:
        """Switches it; an adapter confirms that before this returns."""
        request = termios.TIOCMBIS if on != self._options.inverted else termios.TIOCMBIC
        self._ask(request, _LINES[self._options.line])

    def is_on(self) -> bool:
        """The state that the port's driver has."""
        lines = self._ask(termios.TIOCMGET, 0)
        return bool(lines & _LINES[self._options.line]) != self._options.inverted

    def close(self) -> None:
        """Switches the light off, if that is still possible, and closes the port."""
        file = self._file
        if file is not None:
            # Gone, or no port with such lines: there is no light that could stay on.
            with suppress(DeviceLost, StreamFailed):
                self.switch(False)
            self._file = None
            os.close(file)

    def _ask(self, request: int, lines: int) -> int:
        if self._file is None:
            raise DeviceLost("the serial port is not open", "open it first")
        try:
            answer = self._ioctl(self._file, request, _WORD.pack(lines))
        except OSError as error:
            if error.errno in GONE:
                raise lost(self._options.port) from error
            reason = os.strerror(error.errno or errno.EIO)
            raise StreamFailed(f"the lines of {self._options.port} do not answer: {reason}", PLUG) from error
        return _WORD.unpack(answer)[0]


class SerialLight(SwitchedLight):
    """A light on a control line of a serial port; `SerialLightOptions` lists its options."""

    options_class = SerialLightOptions
    line_class = SerialLine
