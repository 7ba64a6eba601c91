"""Progress of long work, as a share from 0 to 1."""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

Progress = Callable[[float], None]

REPORTS = 200
"""Each report of a job is a message to the daemon; a progress bar shows no finer steps."""


def counted(items: Iterable[T], count: int, progress: Progress) -> Iterator[T]:
    """Passes the items on, and reports which share of `count` is done."""
    step = max(count // REPORTS, 1)
    for done, item in enumerate(items):
        if done % step == 0:
            progress(done / max(count, 1))
        yield item


def portion(progress: Progress, start: float, end: float) -> Progress:
    """Reports the progress of a part of the work as the span from `start` to `end` of the whole."""
    return lambda share: progress(start + (end - start) * share)
