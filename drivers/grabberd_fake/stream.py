"""The simulated driver's buffers: which fields wait in them, and what they hold.

Pictures that a process of their own draws before they are due.

A camera's pictures cost the computer nothing. Drawn by the thread that takes them, they would take 3 ms of
every field, and on a busy computer it is the instrument that would lose fields for it.
"""

import mmap
import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field
from grabberd.errors import StreamFailed
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd_fake import faults
from grabberd_fake.optics import COLUMNS, LINES
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.world import World, random_of

# Luma of Rec. 601 blue and black, and of the eight colour bars.
_NO_SIGNAL_LUMA = {"blue": 41, "black": 16}
_BARS_LUMA = np.array([235, 210, 170, 145, 106, 81, 41, 16], np.uint8)


class Pictures(Protocol):
    """Pictures of a world: a `World` that draws them when they are asked for, or one that draws ahead.

    Attributes:
        waited_ns: time spent so far in waiting for pictures that should have been drawn before.
        origin: camera field with which the script begins, for faults that show in the pictures.
    """

    waited_ns: int
    origin: int

    def picture(self, field: int, out: NDArray[np.uint8]) -> None:
        """Writes the luma of the camera's field number `field` into `out`, (288, 720) or (576, 720)."""
        ...


class Stream:
    """The driver's buffers between one open and close.

    Attributes:
        rows: rows of each field.
        origin: camera field with which the script begins.
    """

    def __init__(
        self, world: Pictures, script: faults.Script, options: FakeOptions, origin: int, first: int, rows: int
    ) -> None:
        self.rows = rows
        self.origin = origin
        self._world, self._script, self._driver = world, script, options.driver
        self._seed = options.seed
        self._each = options.driver.a_buffer
        self._period_ns, self._arrival_ns = options.driver.period_ns, options.driver.arrival_ns
        self._first = self._next = first + (options.driver.order == "bottom_first")
        self._waiting: deque[int] = deque()
        self._free = options.buffers
        self._newest_stamp_ns = -1
        lumas = options.buffers * self._each
        shape = (LINES if options.driver.is_progressive else ROWS, COLUMNS)
        self._lumas = deque(np.empty(shape, np.uint8) for _ in range(lumas))

    def catch_up(self, now_ns: int) -> None:
        """Fills free buffers with what has arrived; without a free buffer a field or frame is lost."""
        newest = self._newest_arrived(now_ns)
        while self._next + self._each - 1 <= newest and self._free:
            if self._delivers(self._next):
                self._waiting.append(self._next)
                self._free -= 1
            self._next += self._each
        behind = newest + 1 - self._next
        self._next += max(behind // self._each * self._each, 0)

    def _newest_arrived(self, now_ns: int) -> int:
        newest = (now_ns - self._arrival_ns) // self._period_ns
        bunch = self._script.at(newest - self.origin, faults.Bunch)
        return newest if bunch is None else self.origin + bunch.first - 1

    def _delivers(self, first: int) -> bool:
        members = range(first, first + self._each)
        return all(self._script.delivers(field - self.origin) for field in members)

    def has_field(self) -> bool:
        """True if a field is waiting."""
        return bool(self._waiting)

    def next_arrival_ns(self) -> int:
        """Time at which the next field or frame is due."""
        field = self._next + self._each - 1
        bunch = self._script.at(field - self.origin, faults.Bunch)
        if bunch is not None:
            field = self.origin + bunch.first + bunch.fields
        return field * self._period_ns + self._arrival_ns

    def take(self, now_ns: int) -> list[GrabbedField]:
        """The oldest waiting field or the fields of a frame; their buffer stays taken until `give_back`.

        The picture is drawn only now: one that is lost or skipped costs nothing.
        """
        first = self._waiting.popleft()
        members = range(first, first + self._each)
        stamp_ns = self._stamp_ns(members[-1], now_ns)
        return [self._grabbed(field, stamp_ns - (members[-1] - field) * self._period_ns) for field in members]

    def give_back(self) -> None:
        """Marks a buffer as free again."""
        self._free += 1

    def _grabbed(self, field: int, stamp_ns: int) -> GrabbedField:
        number = field - self.origin
        luma = self._lumas[0]
        self._lumas.rotate(-1)
        self._draw(field, number, luma)
        damage = "the driver flags an error" if self._script.at(number, faults.Damage) else None
        parity = (field + len(self._script.before(number, faults.Turn))) % 2
        rows = luma[: self.rows]
        picture = Field.progressive(rows) if self._driver.is_progressive else Field.intact(rows, parity)
        return GrabbedField(picture, self._time_ns(number, stamp_ns), self._sequence(field), damage)

    def _sequence(self, field: int) -> int | None:
        if self._driver.counts == "nothing":
            return None
        recounts = self._script.before(field - self.origin, faults.Recount)
        if recounts:
            first, count = self.origin + recounts[-1].first, recounts[-1].count
        else:
            first, count = self._first, -self._script.wraps_after()
        passed = self._script.uncounted(field - self.origin) - self._script.uncounted(first - self.origin)
        counted = field - first - passed
        return (count + (counted // 2 if self._driver.counts == "frames" else counted)) % 2**32

    def _stamp_ns(self, field: int, now_ns: int) -> int:
        """Timestamp of a buffer whose last field this is: never earlier than that of the one before."""
        if self._driver.stamps == "arrival":
            return now_ns - self._arrival_ns
        chance = random_of(self._seed, field)
        late_ns = chance.uniform(0.0, self._driver.jitter_ms) * 1e6
        if chance.random() < self._driver.late:
            late_ns += chance.exponential(self._driver.late_ms) * 1e6
        self._newest_stamp_ns = max(field * self._period_ns + round(late_ns), self._newest_stamp_ns + 1)
        return self._newest_stamp_ns

    def _time_ns(self, number: int, stamp_ns: int) -> int:
        steps = self._script.before(number, faults.ClockStep)
        stamp_ns += sum(round(step.by_s * 1e9) for step in steps)
        wrong = self._script.at(number, faults.Timestamp)
        return stamp_ns if wrong is None else wrong.time_ns(number, stamp_ns)

    def _draw(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        no_signal = self._script.at(number, faults.NoSignal)
        if no_signal is not None:
            _draw_no_signal(no_signal.picture, random_of(self._seed, field), luma)
            return
        repeat = self._script.at(number, faults.Repeat)
        self._world.origin = self.origin
        self._world.picture(self.origin + repeat.first - 1 if repeat else field, luma)
        self._spoil(field, number, luma)

    def _spoil(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        stale = self._script.at(number, faults.Short) or self._script.at(number, faults.Damage)
        if stale is not None:
            luma[stale.row :] = self._lumas[-2][stale.row :]  # as the buffer before was handed over
        shift = self._script.at(number, faults.Shift)
        if shift is not None:
            luma[shift.row :] = np.roll(luma[shift.row :], shift.shift_px)


def _draw_no_signal(picture: str, rng: np.random.Generator, luma: NDArray[np.uint8]) -> None:
    if picture == "noise":
        luma[:] = rng.integers(0, 256, luma.shape, dtype=np.uint8)
    elif picture == "bars":
        luma[:] = np.repeat(_BARS_LUMA, COLUMNS // len(_BARS_LUMA))
    else:
        luma[:] = _NO_SIGNAL_LUMA[picture]


SLOTS = 32
"""As many pictures are kept: .64 s at 50 Hz, longer than a process waits for a busy processor."""
_FIELD = struct.Struct("=q")
_QUESTION = struct.Struct("=qq")
"""A field, and that with which the script begins."""
_STARTED = -1
"""Sent instead of a field's number once the scene is built."""
# The daemon restarts a program whose device does not answer for 15 s.
_START_TIMEOUT_S = 12.0
_PICTURE_TIMEOUT_S = 4.0
_END_TIMEOUT_S = 1.0
_MOST_SHARE = 0.5
"""Of a processor, for a process that comes before others; it needs a fifth."""
_SHARE_OVER_NS = 2_000_000_000
# -P: the current folder may hold a module of any name.
_COMMAND = [sys.executable, "-P", "-c", f"from {__name__} import main; main()"]


class DrawnAhead:
    """The pictures of a `World`, drawn by another process, which ends with this object or this process.

    Attributes:
        waited_ns: Time spent so far in waiting for pictures that were not drawn in time.
    """

    def __init__(self, options: FakeOptions) -> None:
        """Returns once the scene is built.

        Raises:
            StreamFailed: The process does not start.
        """
        self.waited_ns = self.origin = 0
        try:
            self._start(options)
        except OSError as error:
            raise StreamFailed(
                f"the process that draws the simulated pictures does not start: {error}",
                "memory, processes or open files may have run out",
            ) from error
        # By slot, which field it holds as far as it has been reported.
        self._holds: list[int | None] = [None] * SLOTS
        self._asked = 0
        if self._receive(_START_TIMEOUT_S) != _STARTED:
            raise self._failed("sends no greeting")

    def _start(self, options: FakeOptions) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        memory = os.memfd_create("pictures")
        try:
            rows = LINES if options.driver.is_progressive else ROWS
            os.ftruncate(memory, SLOTS * rows * COLUMNS)
            self._slots = _mapped(memory)
            process = _process(memory, theirs.fileno())
            self._end = weakref.finalize(self, _end, process, self._socket)
            assert process.stdin is not None
            with process.stdin as questions:
                pickle.dump(options, questions)
        finally:
            os.close(memory)
            theirs.close()

    def picture(self, field: int, out: NDArray[np.uint8]) -> None:
        """Writes the luma of the camera's field number `field` into `out`, (288, 720) or (576, 720).

        Raises:
            StreamFailed: The process has ended, or draws nothing any more.
        """
        # From now on it draws this one, unless it has, and those after it; the picture of what was asked for
        # last stays, since it may be shown again.
        self._send(field)
        if field < self._asked or self._holds[field % SLOTS] != field:
            self._wait_for(field)
        self._asked = field
        np.copyto(out, self._slots[field % SLOTS])

    def _wait_for(self, field: int) -> None:
        began_ns = time.monotonic_ns()
        while (drawn := self._receive(_PICTURE_TIMEOUT_S)) != field:
            self._holds[drawn % SLOTS] = drawn
        if field < self._asked:
            self._holds = [None] * SLOTS  # what it had drawn of later ones, it draws over
        self._holds[field % SLOTS] = field
        self.waited_ns += time.monotonic_ns() - began_ns

    def _send(self, field: int) -> None:
        try:
            self._socket.send(_QUESTION.pack(field, self.origin))
        except OSError as error:
            raise self._failed("has ended") from error

    def _receive(self, timeout_s: float) -> int:
        self._socket.settimeout(timeout_s)
        try:
            message = self._socket.recv(_FIELD.size)
        except TimeoutError as error:
            raise self._failed(f"has sent nothing for {timeout_s:.0f} s") from error
        except OSError as error:
            raise self._failed("has ended") from error
        if not message:
            raise self._failed("has ended")
        return _FIELD.unpack(message)[0]

    def _failed(self, reason: str) -> StreamFailed:
        self._end()
        return StreamFailed(
            f"the process that draws the simulated pictures {reason}",
            "it is started again with the stream; if it ends again, memory may have run out",
        )


def _process(memory: int, theirs: int) -> "subprocess.Popen[bytes]":
    # Threads of OpenBLAS would wait for each other on a busy computer.
    variables = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(  # noqa: S603 - our own
        [*_COMMAND, str(memory), str(theirs)],
        stdin=subprocess.PIPE,
        pass_fds=(memory, theirs),
        env=variables,
        process_group=0,  # Ctrl-C in a terminal reaches the daemon alone, which ends it
    )


def _end(process: "subprocess.Popen[bytes]", ours: socket.socket) -> None:
    """Ends the process by closing its socket, and by force where it does not notice that."""
    ours.close()
    try:
        process.wait(_END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _mapped(memory: int) -> NDArray[np.uint8]:
    size = os.fstat(memory).st_size
    return np.frombuffer(mmap.mmap(memory, size), np.uint8).reshape(SLOTS, -1, COLUMNS)


def main() -> None:
    """Draws, in the process, until nobody asks any more; arguments are the numbers of memory and socket."""
    # It ends with the daemon, which may still record when systemd tells all its processes to end.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    memory, number = map(int, sys.argv[1:])
    world = World(pickle.load(sys.stdin.buffer))  # noqa: S301 - written by our own process
    with socket.socket(fileno=number) as theirs, suppress(EOFError, ConnectionError):
        _draw(world, _mapped(memory), theirs)


class ComesFirst:
    """Has the process run before other programs where that is permitted, as a camera needs no processor.

    Args:
        clock_ns: Time that goes by.
        ran_ns: Processor time of the process.
        schedule: As `os.sched_setscheduler`.
    """

    def __init__(
        self,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        ran_ns: Callable[[], int] = time.process_time_ns,
        schedule: Callable[[int, int, "os.sched_param"], None] = os.sched_setscheduler,
    ) -> None:
        self._clock_ns, self._ran_ns, self._schedule = clock_ns, ran_ns, schedule
        self._since_ns, self._ran_since_ns = clock_ns(), ran_ns()
        self.first = False
        with suppress(OSError):
            schedule(0, os.SCHED_RR, os.sched_param(1))
            self.first = True

    def keep_to_share(self) -> None:
        """Lets it run like others again where it takes too much: a slow processor is needed for more."""
        now_ns = self._clock_ns()
        if not self.first or now_ns - self._since_ns < _SHARE_OVER_NS:
            return
        ran_ns = self._ran_ns()
        if ran_ns - self._ran_since_ns > _MOST_SHARE * (now_ns - self._since_ns):
            self._schedule(0, os.SCHED_OTHER, os.sched_param(0))
            self.first = False
        self._since_ns, self._ran_since_ns = now_ns, ran_ns


def _draw(world: World, slots: NDArray[np.uint8], theirs: socket.socket) -> None:
    """Draws the field that was asked for last, and those after it as far as there are slots."""
    world.picture(0, slots[0])  # the first takes long: it builds the tables for all others
    theirs.send(_FIELD.pack(_STARTED))
    asked, following = -SLOTS, 0
    first = ComesFirst()
    while True:
        first.keep_to_share()
        for field, world.origin in _asked(theirs, wait=following == asked + SLOTS):
            following = max(following, field) if field >= asked else field
            asked = field
        if following < asked + SLOTS:
            world.picture(following, slots[following % SLOTS])
            theirs.send(_FIELD.pack(following))
            following += 1


def _asked(theirs: socket.socket, *, wait: bool) -> Iterator[tuple[int, int]]:
    """Fields that were asked for meanwhile and the script's first, at least one if it waits.

    Raises:
        EOFError: Nobody asks any more.
    """
    while True:
        try:
            message = theirs.recv(_QUESTION.size, 0 if wait else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        if not message:
            raise EOFError
        yield _QUESTION.unpack(message)
        wait = False
