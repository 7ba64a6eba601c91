"""The clocks that the simulated world runs on."""

import time
from typing import Protocol


class Clock(Protocol):
    """CLOCK_MONOTONIC, or what stands for it."""

    def now_ns(self) -> int:
        """The time."""
        ...

    def sleep_until_ns(self, time_ns: int) -> None:
        """Returns when `time_ns` has come; at once if it has passed."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def sleep_until_ns(self, time_ns: int) -> None:
        """Sleeps."""
        time.sleep(max(time_ns - self.now_ns(), 0) / 1e9)


class JumpingClock:
    """A clock that stands still until somebody sleeps, and then jumps to the end of the sleep."""

    def __init__(self, now_ns: int = 0) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Present time of the clock, in ns."""
        return self._now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        """Jumps forward, never back."""
        self._now_ns = max(self._now_ns, time_ns)
