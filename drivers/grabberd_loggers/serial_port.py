"""Serial lines of text: a microcontroller, a bench logger or an adapter on a serial port or USB."""

import os
import select
import termios
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator

from grabberd.clock import Clock
from grabberd.errors import DeviceLost, StreamFailed
from grabberd_loggers.line_logger import LineLogger, Opened, Received
from grabberd_loggers.options import LineOptions, read_options
from grabberd_loggers.port_file import GONE, PLUG, lost, open_port

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


class SerialLogger(LineLogger):
    """A logger on a serial port; `SerialOptions` lists its options."""

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock that arrivals are dated by; by default the machine's.
            options: see `SerialOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        read = read_options(SerialOptions, options)
        super().__init__(_Port(read), read, clock)


class _Port:
    """A serial port in raw mode."""

    driver = "serial"
    begins_anywhere = True

    def __init__(self, options: SerialOptions) -> None:
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
