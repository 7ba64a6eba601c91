"""A grabber that follows a script, and a capture thread over it in simulated time."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from simulated_time import Run, SimulatedClock

from grabberd.core.field import Field, FieldOrder
from grabberd.documents.enums import DeviceState
from grabberd.errors import (
    DeviceAbsent,
    DeviceRefused,
    StreamFailed,
)
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo

S = DeviceState


INFO = StreamInfo("script", "card", "PAL", 64, 32, 50.0, FieldOrder.ALTERNATE, "GREY", 8, True, True, True, 0)


PERIOD_S = 0.02


class Scripted:
    """A grabber that follows a script: an error to raise by what is asked next, or how many fields to give.

    After its script nothing comes. It keeps what it was asked.
    """

    called_ns = 0
    found_empty = True

    def __init__(self, clock: SimulatedClock, *script: Exception | int, info: StreamInfo = INFO) -> None:
        self.clock = clock
        self.script = list(script)
        self.info = info
        self.reading = Signal.PRESENT
        self.asked: list[str] = []

    def open(self) -> StreamInfo:
        self.asked.append("open")
        self._raise(DeviceAbsent, DeviceRefused)
        return self.info

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        step = self.script.pop(0) if self.script else 0
        if isinstance(step, Exception):
            raise step
        self.clock.sleep(PERIOD_S if step else timeout_s)
        if step > 1:
            self.script.insert(0, step - 1)
        yield [self._field()] if step else []

    def _field(self) -> GrabbedField:
        n = self.clock.now_ns() // 20_000_000
        luma = np.random.default_rng(n).integers(90, 110, (self.info.field_rows, 64)).astype(np.uint8)
        return GrabbedField(Field.intact(luma, n % 2), n * 20_000_000, None, None)

    def _raise(self, *kinds: type[Exception]) -> None:
        if self.script and isinstance(self.script[0], kinds):
            raise self.script.pop(0)  # type: ignore[misc]

    def signal(self) -> Signal:
        return self.reading

    def restart(self) -> StreamInfo:
        self.asked.append("restart")
        self._raise(DeviceRefused, StreamFailed)
        return self.info

    def reset(self) -> None:
        self.asked.append("reset")
        self._raise(DeviceRefused)

    def close(self) -> None:
        self.asked.append("close")


def run(*script: Exception | int, end_s: float = 5.0, info: StreamInfo = INFO) -> tuple[Run, Scripted]:
    clock = SimulatedClock()
    grabber = Scripted(clock, *script, info=info)
    return Run(grabber, clock, end_s), grabber
