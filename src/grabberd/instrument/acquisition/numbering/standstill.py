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
        ended_ns: When the program went on, which may be long before the next field comes; None if unknown.
    """

    time_ns: int
    waited_ns: int | None
    used_ns: int
    called_ns: int = 0
    ended_ns: int | None = None

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


_FROM_BEFORE = 2
"""Buffers after a standstill of the driver that may have been filled before it although they came in time."""


class RecentStandstills:
    """Standstills before which the driver may have filled what still comes; one may follow while another's
    buffers are being emptied.

    Args:
        most: Number of fields after one of which the last may have been filled before it.
        in_turn: Number of fields of a buffer.
    """

    def __init__(self, most: int, in_turn: int) -> None:
        self._most = most
        self._in_time = _FROM_BEFORE * in_turn
        self._left: list[tuple[Standstill, int]] = []

    def before_next(self, latest: Standstill | None, *, in_time: bool) -> tuple[Standstill, ...]:
        """Those that concern the next field, the latest first: that may be right before the field.

        Args:
            latest: Right before it; None if there was none.
            in_time: False if the field may have waited in the driver's buffers.
        """
        if latest is not None:
            self._left.insert(0, (latest, self._most))
        found = tuple(one for one, _ in self._left)
        # One that came in time may still be from before the standstill, but not those after it.
        most = self._in_time if in_time and latest is not None else self._most
        self._left = [(one, min(left - 1, most)) for one, left in self._left if left > 1]
        return found
