"""Time as drivers and threads are given it, so that tests can give them another."""

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock that can be waited on."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        ...

    def sleep(self, seconds: float) -> None:
        """Returns after that time of this clock."""
        ...


class SystemClock:
    """The computer's own."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Sleeps; not at all for zero or less."""
        if seconds > 0:
            time.sleep(seconds)
