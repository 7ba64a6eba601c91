"""The seam between the daemon and what runs it: time, threads, what they wait for, processes and commits.

In use it is the computer: the factories return the standard library's own objects, and a lock costs what a
lock costs. A test installs another runtime, in which one thread runs at a time, time is simulated and a
commit may be the last; see docs/decisions/house.md. Whoever belongs to the daemon takes all of this from
here; ruff refuses the modules themselves. Clocks are injected into drivers, threads and the service, so that
a test of one of them can control time alone.
"""

import os
import pathlib
import queue
import selectors
import sqlite3
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import IO, Any, Protocol, Self, TypeVar

T = TypeVar("T")
Empty = queue.Empty
ChildProcess = subprocess.Popen[bytes]
Path = str | os.PathLike[str]
BOOT_ID_FILE = pathlib.Path("/proc/sys/kernel/random/boot_id")
BOOT_ID_VARIABLE = "GRABBERD_BOOT_ID"
"""Set by the systemd unit, whose sandbox hides the file."""


class Lock(AbstractContextManager[bool], Protocol):
    """See `threading.Lock`."""

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """True once it is held."""
        ...

    def release(self) -> None:
        """Lets another thread have it."""
        ...


class Condition(AbstractContextManager[bool], Protocol):
    """See `threading.Condition`."""

    def wait(self, timeout: float | None = None) -> bool:
        """True if it was notified in time."""
        ...

    def wait_for(self, predicate: Callable[[], T], timeout: float | None = None) -> T:
        """The predicate's last value."""
        ...

    def notify(self, n: int = 1) -> None:
        """Wakes some of those who wait."""
        ...

    def notify_all(self) -> None:
        """Wakes all of them."""
        ...


class Event(Protocol):
    """See `threading.Event`."""

    def is_set(self) -> bool:
        """True since `set`."""
        ...

    def set(self) -> None:
        """Wakes all who wait, for good."""
        ...

    def clear(self) -> None:
        """Lets them wait again."""
        ...

    def wait(self, timeout: float | None = None) -> bool:
        """True if it is set, or was in time."""
        ...


class Queue(Protocol[T]):
    """See `queue.SimpleQueue`."""

    def put(self, item: T) -> None:
        """Adds an item."""
        ...

    def get(self, block: bool = True, timeout: float | None = None) -> T:
        """Takes the oldest item; `Empty` if none comes in time."""
        ...

    def empty(self) -> bool:
        """True if there is none."""
        ...


class Runtime:
    """The computer itself. A simulated one overrides what it simulates."""

    monotonic_ns = staticmethod(time.monotonic_ns)
    monotonic = staticmethod(time.monotonic)
    sleep = staticmethod(time.sleep)

    lock: Callable[[], Lock] = staticmethod(threading.Lock)
    rlock: Callable[[], Lock] = staticmethod(threading.RLock)
    condition: Callable[[Any], Condition] = staticmethod(threading.Condition)
    event: Callable[[], Event] = staticmethod(threading.Event)
    simple_queue: Callable[[], Queue[Any]] = staticmethod(queue.SimpleQueue)

    start = staticmethod(threading.Thread.start)
    join = staticmethod(threading.Thread.join)
    is_alive = staticmethod(threading.Thread.is_alive)

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        return datetime.now(UTC)

    def pool(self, threads: int, name: str) -> Executor:
        """Threads that work calls off."""
        return ThreadPoolExecutor(threads, name)

    def process(self, command: Sequence[str], **options: Any) -> ChildProcess:
        """A started child process."""
        return subprocess.Popen(command, **options)  # noqa: S603 - the caller knows its program

    def read(self, pipe: IO[bytes], timeout_s: float) -> bytes | None:
        """Reads what a pipe of a process holds; None if nothing comes in time, empty once it has ended."""
        with selectors.DefaultSelector() as selector:  # `select` refuses descriptors over 1023
            selector.register(pipe, selectors.EVENT_READ)
            return os.read(pipe.fileno(), 1 << 20) if selector.select(timeout_s) else None

    # Looked up at each call, since tests of full disks replace them.

    def connect(self, database: Path, **options: Any) -> Any:
        """A connection to a database."""
        return sqlite3.connect(database, **options)

    def fsync(self, descriptor: int) -> None:
        """Returns when a file, or a folder's names, are on the disk."""
        os.fsync(descriptor)

    def rename(self, old: Path, new: Path) -> None:
        """Gives a file another name."""
        os.rename(old, new)

    def replace(self, old: Path, new: Path) -> None:
        """The same, in place of what has that name."""
        os.replace(old, new)

    def link(self, old: Path, new: Path) -> None:
        """Gives a file a further name."""
        os.link(old, new)


_installed = Runtime()


@contextmanager
def installed(runtime: Runtime) -> Iterator[None]:
    """Installs a runtime for all threads while the block lasts."""
    global _installed  # noqa: PLW0603 - the one place
    before, _installed = _installed, runtime
    try:
        yield
    finally:
        _installed = before


def monotonic_ns() -> int:
    """CLOCK_MONOTONIC, nanoseconds."""
    return _installed.monotonic_ns()


def monotonic() -> float:
    """The same, seconds."""
    return _installed.monotonic()


def utc_now() -> datetime:
    """Coordinated universal time."""
    return _installed.utc_now()


def sleep(seconds: float) -> None:
    """Returns after that time."""
    _installed.sleep(seconds)


def lock() -> Lock:
    """A new lock."""
    return _installed.lock()


def rlock() -> Lock:
    """A new lock that its holder may acquire again."""
    return _installed.rlock()


def condition(of: Lock | None = None) -> Condition:
    """A new condition of that lock; None: of a reentrant one of its own."""
    return _installed.condition(of)


def event() -> Event:
    """A new event."""
    return _installed.event()


def simple_queue() -> Queue[Any]:
    """A new queue without a bound."""
    return _installed.simple_queue()


class Thread(threading.Thread):
    """A thread of the installed runtime."""

    def start(self) -> None:
        """Begins `run`."""
        _installed.start(self)

    def join(self, timeout: float | None = None) -> None:
        """Waits for its end, or as long as that."""
        _installed.join(self, timeout)

    def is_alive(self) -> bool:
        """True from `start` to the end of `run`."""
        return _installed.is_alive(self)


class Timer(Thread):
    """Calls a function after a time; a daemon thread.

    Raises (`start`):
        RuntimeError: No thread can be started.
    """

    def __init__(self, interval_s: float, function: Callable[[], None]) -> None:
        super().__init__(daemon=True)
        self._interval_s, self._function = interval_s, function
        self._cancelled = event()

    def cancel(self) -> None:
        """Prevents the call, unless it was made already."""
        self._cancelled.set()

    def run(self) -> None:
        """Waits, then calls."""
        if not self._cancelled.wait(self._interval_s):
            self._function()


def pool(threads: int, name: str = "") -> Executor:
    """Threads that work calls off."""
    return _installed.pool(threads, name)


def process(command: Sequence[str], **options: Any) -> ChildProcess:
    """A started child process; further arguments are those of `subprocess.Popen`.

    Raises:
        OSError: It cannot be started.
    """
    return _installed.process(command, **options)


def read(pipe: IO[bytes], timeout_s: float) -> bytes | None:
    """Reads what a pipe of a process holds; None if nothing comes in time, empty once it has ended."""
    return _installed.read(pipe, timeout_s)


def connect(database: Path, **options: Any) -> Any:
    """A connection to a database; further arguments are those of `sqlite3.connect`.

    Raises:
        sqlite3.Error: It cannot be opened.
    """
    return _installed.connect(database, **options)


def fsync(descriptor: int) -> None:
    """Returns when a file, or a folder's names, are on the disk.

    Raises:
        OSError: The disk refuses, as with everything below.
    """
    _installed.fsync(descriptor)


def rename(old: Path, new: Path) -> None:
    """Gives a file another name."""
    _installed.rename(old, new)


def replace(old: Path, new: Path) -> None:
    """The same, in place of what has that name."""
    _installed.replace(old, new)


def link(old: Path, new: Path) -> None:
    """Gives a file a further name."""
    _installed.link(old, new)


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
        return monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep; return at once for zero or less."""
        if seconds > 0:
            sleep(seconds)

    def utc_now(self) -> datetime:
        """Coordinated universal time."""
        return utc_now()


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
