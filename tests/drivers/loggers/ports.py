"""A serial port that a test holds the other end of."""

import fcntl
import os
import sys
import tty
from pathlib import Path


class Port:
    """A pseudo-terminal: `path` is what a logger is plugged into, `say` is the logger."""

    def __init__(self) -> None:
        self._logger, computer = os.openpty()
        tty.setraw(self._logger)
        self.path = Path(os.ttyname(computer))
        # Held open, so that what is said before anybody listens waits.
        self._computer: int | None = computer

    def say(self, text: str | bytes) -> None:
        os.write(self._logger, text.encode() if isinstance(text, str) else text)

    def heard(self) -> bytes:
        return os.read(self._logger, 4096)

    def baud(self) -> int:
        """The speed that the computer has set, as the kernel has it."""
        return int.from_bytes(fcntl.ioctl(self._logger, 0x802C542A, bytes(44))[-4:], sys.byteorder)

    def unplug(self) -> None:
        for end in (self._logger, self._computer):
            if end is not None:
                os.close(end)
        self._logger, self._computer = -1, None

    def close(self) -> None:
        if self._computer is not None:
            self.unplug()
