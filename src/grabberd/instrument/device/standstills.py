"""Standstills: how often and for how long the program took no fields, for people."""

from collections import Counter
from typing import NamedTuple

from grabberd.clock import UtcClock, iso_utc
from grabberd.errors import Cause
from grabberd.instrument.acquisition import Standstill

SHOWN_S = 60.0
"""Time for which a standstill is shown."""
_HINTS = {
    Cause.COMPUTER_BUSY: "close other programs on this computer, or give the driver more buffers",
    Cause.PROGRAM_STOPPED: "look for what stopped it: suspended, swapped out, a virtual machine that paused",
    Cause.DRIVER_HUNG: "look into the kernel's log (dmesg); another port, cable or grabber may help",
}


class ShownStandstill(NamedTuple):
    """A standstill of the last minute.

    Attributes:
        cause: What it was, in a sentence; `hint`: what to do; `code`: the same as a code.
        utc: Time at which it ended.
    """

    cause: str
    hint: str
    code: Cause
    utc: str


class Standstills:
    """Standstills since the daemon started; used by the capture thread, read by everybody.

    Attributes:
        counts: Their number, by cause.
        seconds: Their length together, by cause.
    """

    def __init__(self, clock: UtcClock) -> None:
        self._clock = clock
        self.counts: Counter[Cause] = Counter()
        self.seconds: dict[Cause, float] = dict.fromkeys(_HINTS, 0.0)
        self._latest: tuple[int, Standstill, Cause, str] | None = None

    def note(self, standstill: Standstill) -> bool:
        """Notes one; returns True if people have not been told of its kind within the last minute."""
        now_ns, code = self._clock.now_ns(), _code_of(standstill)
        latest, shown = self._latest, self.shown
        known_ns, goes_on = 0, False
        if latest is not None and now_ns - standstill.time_ns < latest[0]:
            known_ns, code, goes_on = latest[1].time_ns, latest[2], True
        self.counts[code] += not goes_on
        self.seconds[code] += max(0, standstill.time_ns - known_ns) / 1e9
        self._latest = now_ns, standstill, code, iso_utc(self._clock.utc_now())
        return shown is None or shown.code is not _code_of(standstill)

    def hint_of(self, standstill: Standstill) -> str:
        """Advice against one."""
        return _HINTS[_code_of(standstill)]

    @property
    def shown(self) -> ShownStandstill | None:
        """The latest one, if that was within the last minute."""
        if self._latest is None or self._clock.now_ns() - self._latest[0] > SHOWN_S * 1e9:
            return None
        _, standstill, _, utc = self._latest
        return ShownStandstill(standstill.reason, self.hint_of(standstill), _code_of(standstill), utc)


def _code_of(standstill: Standstill) -> Cause:
    if standstill.is_hang:
        return Cause.DRIVER_HUNG
    return Cause.PROGRAM_STOPPED if standstill.is_stop else Cause.COMPUTER_BUSY
