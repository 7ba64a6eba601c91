"""The two clocks that the service reads; tests inject their own."""

from datetime import UTC, datetime
from typing import Protocol

from grabberd.acquisition import clock


class Clock(Protocol):
    """Source of time."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC, nanoseconds."""
        ...

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        ...


class SystemClock(clock.SystemClock):
    """The computer's own clocks."""

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        return datetime.now(UTC)


def iso_utc(moment: datetime) -> str:
    """A moment as ISO 8601 with milliseconds and Z."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
