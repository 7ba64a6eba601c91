"""Standstills of the program, in which it takes no fields, and why."""

from typing import NamedTuple

COMPUTER_BUSY = "computer busy"
PROGRAM_STOPPED = "program stopped"
DRIVER_HUNG = "driver hung"
_MOST_OF_IT = 0.5


class Standstill(NamedTuple):
    """Time for which no fields were taken, since the driver's buffers were empty.

    Attributes:
        time_ns: Its length.
        waited_ns: Part of it in which the capture thread was ready to run and waited for a processor; None
            if the kernel does not report it.
        used_ns: Processor time used by the whole program meanwhile.
        called_ns: Part of it spent in calls to the device, which should return at once.
    """

    time_ns: int
    waited_ns: int | None
    used_ns: int
    called_ns: int = 0

    @property
    def is_stop(self) -> bool:
        """True if the program neither ran nor waited for a processor nor for the device: it was stopped."""
        return self._was_off and not self.is_hang

    @property
    def is_hang(self) -> bool:
        """True if it waited for a call to the device."""
        return self._was_off and self.called_ns >= _MOST_OF_IT * self.time_ns

    @property
    def _was_off(self) -> bool:
        """True if it neither ran nor was ready to run."""
        return self.waited_ns is not None and self.waited_ns + self.used_ns < _MOST_OF_IT * self.time_ns

    @property
    def reason(self) -> str:
        """Cause in a few words, for fields lost meanwhile."""
        if self.waited_ns is None:
            return f"{COMPUTER_BUSY} (took no fields for {_seconds(self.time_ns)})"
        if self.is_hang:
            return f"{DRIVER_HUNG} (a call took {_seconds(self.called_ns)})"
        if self.is_stop:
            return f"{PROGRAM_STOPPED} (for {_seconds(self.time_ns)})"
        if self.waited_ns >= _MOST_OF_IT * self.time_ns:
            return f"{COMPUTER_BUSY} (waited {_seconds(self.waited_ns)} for a processor)"
        return f"{COMPUTER_BUSY} (the program itself, for {_seconds(self.time_ns)})"


def _seconds(time_ns: int) -> str:
    return f"{time_ns / 1e9:.1f} s"


class StandstillOfDriver(Standstill):
    """One in which the driver may have stood still as well, with the whole computer."""

    __slots__ = ()
