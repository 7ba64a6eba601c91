"""A process of clients who visit the daemon, and of one who orders captures, until it is told to end."""

import multiprocessing
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from random import Random
from typing import NamedTuple

from .soak_captures import order
from .soak_clients import WANTS, Host, Visit, visit

CLIENTS = 5
AWAY_S = 1.0
"""A client is away for so long at most."""
PAUSE_S = 1.5
"""Between two captures."""
END_WITHIN_S = 120.0


class Crowd:
    """The process; `visits` and `captures` are there once it has ended.

    Attributes:
        visits: of all clients.
        captures: ids of those that were ordered; `failures`: what went wrong with them.
    """

    def __init__(self, port: int, seed: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._told, here = context.Pipe(duplex=False)
        self._stop = context.Event()
        self._process = context.Process(target=_crowd, args=(Host(port), seed, self._stop, here))
        self._process.start()
        self.visits: list[Visit] = []
        self.captures: list[str] = []
        self.failures: list[str] = []

    def end(self) -> None:
        """Lets everybody leave and the last capture be sealed."""
        self._stop.set()
        if self._told.poll(END_WITHIN_S):
            self.visits, self.captures, self.failures = self._told.recv()
        else:
            self.failures = ["the clients did not come to an end"]
        self._process.join(10)

    def rows(self) -> Iterator[tuple[str, str]]:
        """How many of each kind were there, and the longest a short answer took."""
        counts = (f"{sum(one.what == what for one in self.visits)} {what}" for what in WANTS)
        yield "clients that came and went", ", ".join(counts)
        short = [one.seconds for one in self.visits if one.what in ("picture", "list", "download")]
        yield "longest wait for an answer", f"{max(short, default=0.0):.2f} s"
        yield "of them refused, as they had to be", str(sum(one.refused for one in self.visits))


@contextmanager
def crowd(port: int, seed: int) -> Iterator[Crowd]:
    """One that comes and goes until the end of the block."""
    here = Crowd(port, seed)
    try:
        yield here
    finally:
        here.end()


class _Told(NamedTuple):
    """What is collected, by appending alone."""

    visits: list[Visit]
    captures: list[str]
    failures: list[str]


def _crowd(host: Host, seed: int, stop: Event, tell: Connection) -> None:
    told = _Told([], [], [])
    works = [
        threading.Thread(target=_visiting, args=(host, Random(seed + n), stop, told)) for n in range(CLIENTS)
    ]
    works.append(threading.Thread(target=_ordering, args=(host, Random(seed - 1), stop, told)))
    for work in works:
        work.start()
    for work in works:
        work.join()
    tell.send(tuple(told))


def _visiting(host: Host, random: Random, stop: Event, told: _Told) -> None:
    while not stop.is_set():
        told.visits.append(visit(host, random))
        stop.wait(random.uniform(0.0, AWAY_S))


def _ordering(host: Host, random: Random, stop: Event, told: _Told) -> None:
    while not stop.is_set():
        try:
            told.captures.append(order(host, random, stop.wait))
        except Exception as error:
            told.failures.append(f"a capture: {type(error).__name__}: {error}")
            time.sleep(1.0)
        stop.wait(random.uniform(0.1, PAUSE_S))
