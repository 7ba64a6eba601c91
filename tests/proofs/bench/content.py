"""Cost of a field taken in, from the driver's buffer to packed bits: processor time of one thread."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.content_found import lost

from grabberd.core.field import Field, Packing
from grabberd.core.kernel import KERNEL, in_use
from grabberd.instrument.acquisition.content_check import ContentCheck
from grabberd.instrument.acquisition.device import GRABBERS, GrabbedField

FIELDS = 300
RATE_HZ = 50
THRESHOLD = 60
BUFFERS = 16
"""A driver fills them in turn, so none is in the processor's cache any more when its turn comes."""

Luma = NDArray[np.uint8]
Place = Callable[[Luma, int], Luma]


def table() -> str:
    """Medians and 99 % quantiles, by how rows lie in the buffer, how they are packed, and what they show."""
    lumas = _grabbed()
    black = [np.where(luma > 30, luma, 0).astype(np.uint8) for luma in lumas]
    shifted = [lost(luma, 144, 40 * (n % 2)) for n, luma in enumerate(lumas)]
    rows = [_row(layout, "1 bit, doubled", "liner", lumas) for layout in LAYOUTS]
    rows += [_row("YUYV, woven", packing, "liner", lumas) for packing in list(PACKINGS)[1:]]
    rows.append(_row("YUYV, woven", "1 bit, doubled", "liner, black clipped", black))
    rows.append(_row("YUYV, woven", "1 bit, doubled", "40 px lost in every other field", shifted))
    by = f"By the {in_use()}, and by numpy alone; {FIELDS} fields, by turns.\n"
    head = (
        f"| buffer | packed | picture | µs a field | 99 % | of a core at {RATE_HZ} Hz | by numpy, µs | 99 % |"
    )
    return "\n".join([by, head, "|---|---|---|---|---|---|---|---|", *rows])


LAYOUTS: dict[str, Place] = {
    "GREY, fields": lambda buffer, parity: buffer[:288, :720],
    "GREY, woven": lambda buffer, parity: buffer[parity::2, :720],
    "YUYV, woven": lambda buffer, parity: buffer[parity::2, ::2],
}
"""Views of a field in a buffer of 576 lines of 1440 bytes."""

PACKINGS = {
    "1 bit, doubled": Packing(1, doubled=True, threshold=THRESHOLD),
    "1 bit, doubled, a threshold for each pixel": Packing(
        1, doubled=True, threshold=THRESHOLD, by_pixel=np.full((576, 720), THRESHOLD, np.uint8)
    ),
    "1 bit": Packing(1, doubled=False, threshold=THRESHOLD),
    "4 bits": Packing(4, doubled=False, threshold=THRESHOLD),
    "6 bits": Packing(6, doubled=False, threshold=THRESHOLD),
    "8 bits": Packing(8, doubled=False, threshold=THRESHOLD),
    "8 bits, doubled": Packing(8, doubled=True, threshold=THRESHOLD),
}


def _grabbed() -> list[Luma]:
    grabber = GRABBERS.create("fake", {"pace": "free"})
    grabber.open()
    lumas: list[Luma] = []
    while len(lumas) < FIELDS:
        with grabber.dequeue(1.0) as some:
            lumas += [one.field.luma.copy() for one in some]
    grabber.close()
    return lumas


def _row(layout: str, packing: str, picture: str, lumas: Sequence[Luma]) -> str:
    checks = ContentCheck(KERNEL), ContentCheck(None)
    taken: tuple[list[float], list[float]] = [], []
    buffers = np.zeros((BUFFERS, 576, 1440), np.uint8)
    for n, luma in enumerate(lumas):
        view = LAYOUTS[layout](buffers[n % BUFFERS], n % 2)
        view[:] = luma
        buffers[(n + 1) % BUFFERS].sum()  # the processor's cache has something else now
        grabbed = GrabbedField(Field.intact(view, n % 2), n * 20_000_000, n, None)
        for check, times in zip(checks, taken, strict=True):
            before = time.thread_time_ns()
            check.take(grabbed, PACKINGS[packing])
            times.append((time.thread_time_ns() - before) / 1000)
    (median, late), by_numpy = (np.percentile(times, (50, 99)) for times in taken)
    share = f"{median * RATE_HZ / 1e6:.2%}"
    numbers = f"{median:.0f} | {late:.0f} | {share} | {by_numpy[0]:.0f} | {by_numpy[1]:.0f}"
    return f"| {layout} | {packing} | {picture} | {numbers} |"
