"""Pictures that a process of their own draws before they are due.

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
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import StreamFailed
from grabberd_fake.optics import COLUMNS, LINES
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.world import World

SLOTS = 32
"""As many pictures are kept: .64 s at 50 Hz, longer than a process waits for a busy processor."""
_FIELD = struct.Struct("=q")
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
        self.waited_ns = 0
        try:
            self._start(options)
        except OSError as error:
            raise StreamFailed(
                f"the process that draws the simulated pictures does not start: {error}",
                "memory, processes or open files may have run out",
            ) from error
        # By slot, which field it holds as far as it has been told.
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
            self._socket.send(_FIELD.pack(field))
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
        for field in _asked(theirs, wait=following == asked + SLOTS):
            following = max(following, field) if field >= asked else field
            asked = field
        if following < asked + SLOTS:
            world.picture(following, slots[following % SLOTS])
            theirs.send(_FIELD.pack(following))
            following += 1


def _asked(theirs: socket.socket, *, wait: bool) -> Iterator[int]:
    """Fields that were asked for meanwhile, at least one if it waits.

    Raises:
        EOFError: Nobody asks any more.
    """
    while True:
        try:
            message = theirs.recv(_FIELD.size, 0 if wait else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        if not message:
            raise EOFError
        yield _FIELD.unpack(message)[0]
        wait = False
