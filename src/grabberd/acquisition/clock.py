"""Clock injected into drivers and threads, so that tests can control time."""

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock that can be waited on."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        ...

    def sleep(self, seconds: float) -> None:
        """Return after that much time of this clock."""
        ...


class SystemClock:
    """The computer's own clock."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep; return at once for zero or less."""
        if seconds > 0:
            time.sleep(seconds)
