"""The whole daemon in this process, on the simulated grabber, and what it costs."""

import os
import socket
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import uvicorn

from grabberd.config import default_config_file, load_config
from grabberd.instrument.acquisition.device import GrabbedField, Grabber
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import set_up
from grabberd.memory import keep_freed_memory
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service

CAPTURE = "capture-"
"""What the name of a capture thread begins with."""


class TimedGrabber:
    """Another grabber, with what its dequeueing costs of the processor's time."""

    def __init__(self, grabber: Grabber) -> None:
        self._grabber = grabber
        self.cpu_s = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._grabber, name)

    def dequeue(self, timeout_s: float) -> AbstractContextManager[Sequence[GrabbedField]]:
        return self._timed(timeout_s)

    @contextmanager
    def _timed(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        before = time.thread_time()
        with self._grabber.dequeue(timeout_s) as fields:
            self.cpu_s += time.thread_time() - before
            yield fields


class Daemon(NamedTuple):
    """What runs: its service, the grabber, the port that it serves on."""

    service: Service
    grabber: TimedGrabber
    port: int

    @property
    def instrument(self) -> Instrument:
        return self.service.instrument(None)

    def wait_until_ready(self, seconds: float = 30.0) -> None:
        board = self.instrument.board
        with board.changed:
            board.changed.wait_for(lambda: self.instrument.captures.accepts, seconds)


@contextmanager
def daemon(folder: Path) -> Iterator[Daemon]:
    """As `grabberd serve` runs it without a configuration; its captures go into the folder."""
    file = default_config_file()
    name, setup = next(iter(set_up(load_config(file), file).items()))
    timed = TimedGrabber(setup.grabber)
    object.__setattr__(setup, "grabber", timed)
    service = Service({name: setup}, folder)
    with served(service) as port:
        yield Daemon(service, timed, port)


@contextmanager
def served(service: Service) -> Iterator[int]:
    """Any service, started, on the port that is given."""
    sys.setswitchinterval(0.001)
    keep_freed_memory()
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(create_app(service), log_level="warning"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, name="server")
        thread.start()
        try:
            yield listening.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join(30)


def resident_mb() -> float:
    """Of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Cost:
    """Shares of a core since it was made."""

    def __init__(self, grabber: TimedGrabber) -> None:
        self._grabber = grabber
        self._start = time.monotonic(), time.process_time(), grabber.cpu_s
        self._threads = _threads()

    def shares(self) -> dict[str, float]:
        """Of everything, of the simulator's rendering, and, without that, of the threads that lived on."""
        wall_s, all_s, rendering_s = (
            now - then
            for now, then in zip(
                (time.monotonic(), time.process_time(), self._grabber.cpu_s), self._start, strict=True
            )
        )
        threads = {
            name: now.ran_s - rendering_s * name.startswith(CAPTURE) for name, now in self._since().items()
        }
        shares = {"everything": all_s, "the rendering": rendering_s}
        shares |= {name: used for name, used in threads.items() if used > 0.005 * wall_s}
        return {name: used / wall_s for name, used in shares.items()}

    def waited_s(self) -> float:
        """How long the capture thread was ready to run, and the machine had no core for it."""
        return sum(thread.waited_s for name, thread in self._since().items() if name.startswith(CAPTURE))

    def _since(self) -> dict[str, "_Thread"]:
        now = _threads()
        return {
            name: _Thread(now[name].ran_s - then.ran_s, now[name].waited_s - then.waited_s)
            for name, then in self._threads.items()
            if name in now
        }


class _Thread(NamedTuple):
    """What a thread has had of the processors, and how long it has waited for one."""

    ran_s: float
    waited_s: float


def _threads() -> dict[str, _Thread]:
    return {
        thread.name: _Thread(*(int(ns) / 1e9 for ns in _schedstat(thread.native_id)[:2]))
        for thread in threading.enumerate()
        if thread.native_id
    }


def _schedstat(thread_id: int) -> list[str]:
    return Path(f"/proc/self/task/{thread_id}/schedstat").read_text().split()
