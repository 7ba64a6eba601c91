"""A model of camera, driver and computer, without pictures: what comes, when, and which field it is.

A camera exposes fields at its own rate. A bus loses some of them, with or without the driver's notice. The
driver stamps the others, counts them and keeps them in its buffers; when none is free, it loses them too. The
computer takes them out while it runs.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.field import Field, FieldOrder
from grabberd.instrument.acquisition.device import GrabbedField, StreamInfo
from instrument.acquisition.streams import MS, PERIOD_NS, START_NS, info

_LUMA = np.zeros((4, 8), np.uint8)
_TRANSPORT_NS = 30 * MS
"""From the middle of the exposure to the driver's buffer."""
_PER_FRAME = {FieldOrder.TOP_FIRST: 2, FieldOrder.BOTTOM_FIRST: 2, FieldOrder.ALTERNATE: 1}


class Taken(NamedTuple):
    """A field as it was dequeued, and which of the camera's it is."""

    grabbed: GrabbedField
    now_ns: int
    n: int


@dataclass(frozen=True)
class GrabberModel:
    """What goes wrong in a run.

    Attributes:
        order: of the fields; frames of two are lost and stamped as wholes.
        stamps: `exposure`, as good drivers give, or `arrival`, the time of the dequeuing.
        counts: the driver's count: `none`, of `fields`, or of `frames`, which both fields of a frame share.
        buffers: of the driver, in its own units.
        grid_ms: of the stamps, which its clock rounds down; 0 for a clock that does not tick.
        drift: of the camera's clock.
        jitter_ms: of the stamps, uniform.
        late: share of stamps that are late, by `late_ms` on average.
        losses: first field and number of those that the bus loses; `silent`: without a gap in the count.
        pauses: time in s and length in s for which the computer does not run.
        clock_jumps: time in s and jump in s of the clock of the stamps.
        turns: fields from which on the camera's phase is the other.
        zero_stamps: first field and number of those with a stamp of 0.
        count_restarts: fields at which the driver's count begins anew.
    """

    order: FieldOrder = FieldOrder.ALTERNATE
    stamps: str = "exposure"
    counts: str = "none"
    buffers: int = 8
    grid_ms: float = 0.0
    drift: float = 0.0
    jitter_ms: float = 1.0
    late: float = 0.0
    late_ms: float = 25.0
    losses: tuple[tuple[int, int], ...] = ()
    silent: tuple[tuple[int, int], ...] = ()
    pauses: tuple[tuple[float, float], ...] = ()
    clock_jumps: tuple[tuple[float, float], ...] = ()
    turns: tuple[int, ...] = ()
    zero_stamps: tuple[tuple[int, int], ...] = ()
    count_restarts: tuple[int, ...] = ()
    fields: int = 600
    seed: int = 0
    first_count: int = field(default=1)

    @property
    def info(self) -> StreamInfo:
        """The stream as such a driver grants it."""
        granted = info(self.order, counts_losses=self.counts != "none")
        return replace(
            granted, buffers=self.buffers * _PER_FRAME[self.order], driver=f"model ({self.stamps})"
        )

    def run(self) -> list[Taken]:
        """All that is dequeued, in order."""
        return list(self._taken())

    def _taken(self) -> Iterator[Taken]:
        random = np.random.default_rng(self.seed)
        waiting: deque[tuple[int, list[tuple[int, int]], int]] = deque()
        per, free_ns, newest_stamp = _PER_FRAME[self.order], 0, 0
        phase = self.order is FieldOrder.BOTTOM_FIRST
        count = self.first_count
        for first in range(phase, self.fields, per):
            members = range(first, first + per)
            last_ns = self.exposed_ns(members[-1])
            done_ns = last_ns + _TRANSPORT_NS + int(random.uniform(0, 2) * MS)
            stamp_late = int(random.uniform(0, self.jitter_ms) * MS)
            if random.random() < self.late:
                stamp_late += int(random.exponential(self.late_ms) * MS)
            if first in self.count_restarts:
                count = 0
            silent = _within(first, self.silent)
            if not silent:
                count += self._counted(first)
            # What was waiting is taken before this one comes, unless the computer stands still.
            while waiting and (taken := self._runs_from(max(waiting[0][0], free_ns))) <= done_ns:
                free_ns = taken + int(random.exponential(0.3) * MS)
                yield from self._dequeued(waiting.popleft(), free_ns)
            if silent or _within(first, self.losses) or len(waiting) >= self.buffers:
                continue
            newest_stamp = max(newest_stamp + 1, last_ns + stamp_late)
            stamped = [(n, newest_stamp - (members[-1] - n) * PERIOD_NS) for n in members]
            waiting.append((done_ns, stamped, count))
        while waiting:
            free_ns = self._runs_from(max(waiting[0][0], free_ns)) + int(random.exponential(0.3) * MS)
            yield from self._dequeued(waiting.popleft(), free_ns)

    def exposed_ns(self, n: int) -> int:
        """Middle of the exposure of the camera's field n."""
        return START_NS + round(n * PERIOD_NS * (1 + self.drift))

    def _counted(self, first: int) -> int:
        if self.counts == "frames":
            return (first + 1) % 2
        return _PER_FRAME[self.order]

    def _runs_from(self, time_ns: int) -> int:
        """When the computer takes what came at a time."""
        for at_s, length_s in self.pauses:
            begin, end = (START_NS + int(s * 1e9) for s in (at_s, at_s + length_s))
            if begin <= time_ns < end:
                return end
        return time_ns

    def _dequeued(self, buffer: tuple[int, list[tuple[int, int]], int], now_ns: int) -> Iterator[Taken]:
        _, stamped, count = buffer
        last_n = stamped[-1][0]
        for n, stamp_ns in stamped:
            if self.stamps == "arrival":
                said_ns = now_ns - _TRANSPORT_NS - (last_n - n) * PERIOD_NS
            else:
                said_ns = stamp_ns
            said_ns += sum(int(jump * 1e9) for at_s, jump in self.clock_jumps if n >= at_s * 50)
            said_ns -= said_ns % max(round(self.grid_ms * MS), 1)
            if _within(n, self.zero_stamps):
                said_ns = 0
            turned = sum(n >= turn for turn in self.turns)
            sequence = None if self.counts == "none" else (count - (last_n - n)) % 2**32
            grabbed = GrabbedField(Field.intact(_LUMA, (n + turned) % 2), said_ns, sequence, None)
            yield Taken(grabbed, now_ns, n)


def _within(n: int, spans: tuple[tuple[int, int], ...]) -> bool:
    return any(first <= n < first + count for first, count in spans)
