"""A process beside the daemon that notes when the machine itself stands still."""

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from typing import Any, NamedTuple

PERIOD_S = 0.005
LONG_S = 0.02


class Stalls(NamedTuple):
    """What the witness saw: the longest stall, and how many of over twenty milliseconds."""

    longest_s: float
    long_ones: int


class Witness:
    """Sleeps five milliseconds at a time and notes by how much it overslept."""

    def __init__(self, seen: Any) -> None:
        self._seen = seen

    @property
    def stalls(self) -> Stalls:
        """Those so far."""
        return Stalls(self._seen[0], int(self._seen[1]))


@contextmanager
def witness() -> Iterator[Witness]:
    """One that watches until the end of the block."""
    context = multiprocessing.get_context("spawn")
    seen, stop = context.Array("d", 2), context.Event()
    process = context.Process(target=_watch, args=(seen, stop))
    process.start()
    try:
        yield Witness(seen)
    finally:
        stop.set()
        process.join(10)


def _watch(seen: Any, stop: Event) -> None:
    last = time.monotonic()
    while not stop.is_set():
        time.sleep(PERIOD_S)
        now = time.monotonic()
        late = now - last - PERIOD_S
        seen[0] = max(seen[0], late)
        seen[1] += late > LONG_S
        last = now
