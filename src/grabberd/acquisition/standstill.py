"""Standstill: the program took no fields for a while, and what the kernel's account says of that."""

from typing import NamedTuple

COMPUTER_BUSY = "computer busy"
PROGRAM_STOPPED = "program stopped"
_MOST_OF_IT = 0.5


class Standstill(NamedTuple):
    """Time for which no fields were taken, since the driver's buffers were empty.

    Attributes:
        time_ns: All of it.
        waited_ns: Time in it for which the capture thread could have run and waited for a processor; None
            where the kernel does not tell.
        used_ns: Processor time that the whole program used in it.
    """

    time_ns: int
    waited_ns: int | None
    used_ns: int

    @property
    def is_stop(self) -> bool:
        """True if the program neither ran nor waited for a processor: something had stopped it."""
        return self.waited_ns is not None and self.waited_ns + self.used_ns < _MOST_OF_IT * self.time_ns

    @property
    def reason(self) -> str:
        """Cause in a few words, for fields that are lost meanwhile."""
        if self.waited_ns is None:
            return f"{COMPUTER_BUSY} (took no fields for {_seconds(self.time_ns)})"
        if self.is_stop:
            return f"{PROGRAM_STOPPED} (for {_seconds(self.time_ns)})"
        if self.waited_ns >= _MOST_OF_IT * self.time_ns:
            return f"{COMPUTER_BUSY} (waited {_seconds(self.waited_ns)} for a processor)"
        return f"{COMPUTER_BUSY} (the program itself, for {_seconds(self.time_ns)})"


def _seconds(time_ns: int) -> str:
    return f"{time_ns / 1e9:.1f} s"
