"""A model of a device that is paced by the kernel's tick, as its test driver `vivid` is.

It wakes at the tick next to each period's end, stamps the buffer there, draws into it and hands it over. Its
first buffer it fills as soon as it is asked for, between two ticks.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.field import Field, FieldOrder
from grabberd.instrument.acquisition.device import GrabbedField, StreamInfo
from instrument.acquisition.streams import MS, START_NS, info

_LUMA = np.zeros((4, 8), np.uint8)
_WOVEN = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}


class Ticked(NamedTuple):
    """A field as it was dequeued, and which of the device's it is."""

    grabbed: GrabbedField
    now_ns: int
    n: int


@dataclass(frozen=True)
class TickedDevice:
    """Device whose buffers come at ticks.

    Attributes:
        rate_hz: Fields or pictures per second.
        order: Of the fields.
        tick_ms: From tick to tick.
        asked_ms: From the last tick to the request, at which the first buffer is filled.
        draws_ms: Time to fill a buffer; `varies_ms`: more or less by up to so much.
        late: Share of buffers for which it wakes one to three ticks late.
        counts: True if its count is trusted; both fields of an alternating frame share one.
        left_out: Buffers before the first one that is numbered.
        lost: Buffers that are counted and not delivered.
        buffers: Number of them that come.
        seed: Of the time that drawing takes.
    """

    rate_hz: float
    order: FieldOrder = FieldOrder.PROGRESSIVE
    tick_ms: float = 4.0
    asked_ms: float = 1.0
    draws_ms: float = 5.0
    varies_ms: float = 2.0
    late: float = 0.0
    counts: bool = True
    left_out: int = 0
    lost: tuple[int, ...] = ()
    buffers: int = 600
    seed: int = 0

    @property
    def info(self) -> StreamInfo:
        """The stream as the driver grants it."""
        granted = info(self.order, rate_hz=self.rate_hz, counts_losses=self.counts)
        return replace(granted, buffers=16 * self._per)

    @property
    def asked_ns(self) -> int:
        """When the stream was asked for."""
        return START_NS + round(self.asked_ms * MS)

    def run(self) -> Iterator[Ticked]:
        """All fields that are dequeued, in order."""
        random = np.random.default_rng(self.seed)
        per, period_ns = self._per, 1e9 / self.rate_hz
        for buffer in range(self.left_out, self.buffers):
            tick = round(buffer * per * period_ns / (self.tick_ms * MS))
            tick += int(random.integers(1, 4)) * bool(random.random() < self.late)
            stamp_ns = START_NS + round(tick * self.tick_ms * MS) if buffer else self.asked_ns
            now_ns = stamp_ns + round((self.draws_ms + random.uniform(-self.varies_ms, self.varies_ms)) * MS)
            if buffer in self.lost:
                continue
            for member in range(per):
                n = buffer * per + member
                # The stamp is the start of the exposure; its middle is half a period later.
                time_ns = stamp_ns + round((member + 0.5) * period_ns)
                counted = buffer // 2 if self.order is FieldOrder.ALTERNATE else n
                yield Ticked(GrabbedField(self._field(n), time_ns, counted, None), now_ns, n)

    @property
    def _per(self) -> int:
        return 2 if self.order in _WOVEN else 1

    def _field(self, n: int) -> Field:
        if self.order is FieldOrder.PROGRESSIVE:
            return Field.progressive(_LUMA)
        return Field.intact(_LUMA, (n + _WOVEN.get(self.order, 1)) % 2)
