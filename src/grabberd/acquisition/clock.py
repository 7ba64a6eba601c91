"""Clocks injected into drivers, threads and the service, so that tests can control time."""

import time
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Protocol, Self


class Clock(Protocol):
    """A monotonic clock that can be waited on."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        ...

    def sleep(self, seconds: float) -> None:
        """Return after that much time of this clock."""
        ...


class UtcClock(Protocol):
    """A monotonic clock that knows the time of day, too."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        ...

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        ...


class SystemClock:
    """The computer's own clocks."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep; return at once for zero or less."""
        if seconds > 0:
            time.sleep(seconds)

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class Moment:
    """One moment by both clocks.

    Attributes:
        ns: CLOCK_MONOTONIC, nanoseconds.
        utc: ISO 8601.
    """

    ns: int
    utc: str

    @classmethod
    def now(cls, clock: UtcClock) -> Self:
        """The present moment."""
        return cls(clock.now_ns(), iso_utc(clock.utc_now()))


def iso_utc(moment: datetime) -> str:
    """A moment as ISO 8601 with milliseconds and Z."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
