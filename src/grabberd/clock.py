"""Clocks injected into drivers, threads and the service, so that tests can control time."""

import os
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Protocol, Self

from grabberd import runtime

BOOT_ID_FILE = Path("/proc/sys/kernel/random/boot_id")
BOOT_ID_VARIABLE = "GRABBERD_BOOT_ID"
"""Set by the systemd unit, whose sandbox hides the file."""


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
        return runtime.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep; return at once for zero or less."""
        if seconds > 0:
            runtime.sleep(seconds)

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        return runtime.utc_now()


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


@dataclass(frozen=True, slots=True)
class Now:
    """The present moment by both clocks, and the start of the computer that its monotonic clock counts from.

    Attributes:
        ns: CLOCK_MONOTONIC, nanoseconds.
        utc: Time of day.
        boot_id: Id of the kernel's start; empty if it is unknown.
    """

    ns: int
    utc: datetime
    boot_id: str

    @classmethod
    def by_the_system(cls) -> Self:
        """The present moment by the computer's own clocks."""
        clock = SystemClock()
        return cls(clock.now_ns(), clock.utc_now(), boot_id())


@cache
def boot_id() -> str:
    """The kernel's id of this start of the computer, 32 hexadecimal digits; empty if it is unknown.

    Times of CLOCK_MONOTONIC can be compared only within one start.
    """
    try:
        given = BOOT_ID_FILE.read_text(encoding="ascii")
    except (OSError, ValueError):
        given = os.environ.get(BOOT_ID_VARIABLE, "")
    return given.strip().replace("-", "")


def iso_utc(moment: datetime) -> str:
    """A moment as ISO 8601 with milliseconds and Z."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def utc_of(clock: UtcClock, time_ns: int) -> datetime:
    """The time of day of a moment of CLOCK_MONOTONIC."""
    return clock.utc_now() - timedelta(microseconds=(clock.now_ns() - time_ns) // 1000)


def utc_us(clock: UtcClock, time_ns: int) -> int:
    """The same in µs since 1970."""
    return (utc_of(clock, time_ns) - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1)
