"""A live grabber that costs nearly nothing: pictures rendered beforehand, one every 20 ms, over and over."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field, FieldOrder
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo
from grabberd_fake import FakeGrabber

PERIOD_NS = 20_000_000
BUFFERS = 16


def rendered(count: int) -> NDArray[np.uint8]:
    """The simulated liner in so many fields, (count, 288, 720); two cycles of pulsation in a hundred."""
    grabber = FakeGrabber(pace="free", picture={"stamp": False})
    info = grabber.open()
    pictures = np.empty((count, info.field_rows, info.columns), np.uint8)
    done = 0
    while done < count:
        with grabber.dequeue(1.0) as fields:
            for one in fields:
                pictures[done] = one.field.luma
                done += 1
    grabber.close()
    return pictures


class LoopedGrabber:
    """As a frame grabber whose driver has sixteen buffers: what finds none free is lost, and counted.

    Args:
        pictures: shared with others; the first is of a top field, their number even.
        begin: with which of them it begins.
    """

    called_ns = 0

    def __init__(self, pictures: NDArray[np.uint8], begin: int) -> None:
        self._pictures = pictures
        self._begin = begin
        self._next = 0
        self.lost = 0
        self.found_empty = False

    def open(self) -> StreamInfo:
        self._next = 2 * (time.monotonic_ns() // (2 * PERIOD_NS)) + 2
        _, rows, columns = self._pictures.shape
        order = FieldOrder.ALTERNATE
        return StreamInfo(
            "looped", "none", "PAL", columns, rows, 50.0, order, "GREY", BUFFERS, True, True, True, 1000
        )

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        wait_s = self._next * PERIOD_NS / 1e9 - time.monotonic()
        self.found_empty = wait_s > 0
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            yield ()
            return
        if wait_s > 0:
            time.sleep(wait_s)
        n, self._next = self._next, self._next + 1
        luma = self._pictures[(n + self._begin) % len(self._pictures)]
        yield (GrabbedField(Field.intact(luma, n % 2), n * PERIOD_NS, n, None),)
        late = time.monotonic_ns() // PERIOD_NS - self._next + 1 - BUFFERS
        if late > 0:
            self._next += late
            self.lost += late

    def signal(self) -> Signal:
        return Signal.PRESENT

    def restart(self) -> StreamInfo:
        return self.open()

    def reset(self) -> None: ...

    def close(self) -> None: ...
