"""What a look at a field's content costs: processor time of one thread, and its share of a core at 50 Hz."""

import time
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray
from tests.bench.content_found import lost

from grabberd.acquisition.checks.content_check import ContentCheck
from grabberd.acquisition.device import GrabbedField
from grabberd.acquisition.registry import create
from grabberd.field import Field

FIELDS = 300
RATE_HZ = 50

Luma = NDArray[np.uint8]


def table() -> str:
    """Medians and 99 % quantiles, by how the rows lie in the driver's buffer and what they show."""
    lumas = _grabbed()
    rows = [_row(layout, "liner", lumas, place) for layout, place in LAYOUTS.items()]
    black = [np.where(luma > 30, luma, 0).astype(np.uint8) for luma in lumas]
    rows.append(_row("GREY, fields", "liner, black clipped", black, LAYOUTS["GREY, fields"]))
    shifted = [lost(luma, 144, 40 * (n % 2)) for n, luma in enumerate(lumas)]
    rows.append(_row("GREY, fields", "40 px lost in every other field", shifted, LAYOUTS["GREY, fields"]))
    head = f"| buffer | picture | ms a field | 99 % | of a core at {RATE_HZ} Hz |"
    return "\n".join([head, "|---|---|---|---|---|", *rows])


LAYOUTS: dict[str, Callable[[Luma, int], Luma]] = {
    "GREY, fields": lambda buffer, parity: buffer[:288, :720],
    "GREY, woven": lambda buffer, parity: buffer[parity::2, :720],
    "YUYV, woven": lambda buffer, parity: buffer[parity::2, ::2],
}
"""Views of a field in a buffer of 576 lines of 1440 bytes."""


def _grabbed() -> list[Luma]:
    grabber = create("fake", {"pace": "free"})
    grabber.open()
    lumas: list[Luma] = []
    while len(lumas) < FIELDS:
        with grabber.dequeue(1.0) as some:
            lumas += [one.field.luma.copy() for one in some]
    grabber.close()
    return lumas


def _row(layout: str, picture: str, lumas: Iterable[Luma], place: Callable[[Luma, int], Luma]) -> str:
    buffer = np.zeros((576, 1440), np.uint8)
    check, times = ContentCheck(), []
    for n, luma in enumerate(lumas):
        view = place(buffer, n % 2)
        view[:] = luma
        grabbed = GrabbedField(Field.intact(view, n % 2), n * 20_000_000, n, None)
        before = time.thread_time_ns()
        check.look(grabbed)
        times.append(time.thread_time_ns() - before)
    median, late = np.percentile(times, (50, 99)) / 1e6
    return f"| {layout} | {picture} | {median:.2f} | {late:.2f} | {median * RATE_HZ / 1000:.1%} |"
