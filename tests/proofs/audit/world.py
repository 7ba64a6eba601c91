"""A camera, its cable and its kernel driver, as the kernel's documentation lets them behave.

Written from "Streaming I/O" and "Buffers" of the V4L2 documentation, not from the code that is audited: a
driver fills its queued buffers one after the other, stamps and counts them in one of the documented ways, and
drops what begins to come while none is free. What is true of every field is kept beside.
"""

import math
import random
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import LossCause
from grabberd_v4l2 import abi

S, MS = 1_000_000_000, 1_000_000
WOVEN = (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
Causes = frozenset[LossCause]
COMPUTER, CABLE = frozenset({LossCause.COMPUTER}), frozenset({LossCause.CABLE})
DEVICE, CAMERA = frozenset({LossCause.DEVICE}), frozenset({LossCause.CAMERA})


class Span(NamedTuple):
    """A time of the run, in s since its begin, and what it is like: a mean in ms, a share, an amount in s."""

    begin_s: float
    end_s: float
    amount: float = 0.0

    def __contains__(self, at_s: object) -> bool:
        return isinstance(at_s, float) and self.begin_s <= at_s < self.end_s


class Loss(NamedTuple):
    """Losses on the way to the driver.

    Attributes:
        span: While it lasts.
        of: `all`, `some of each` so many, `at random`, or of `one parity`.
        counted: Whether the driver notices.
        lost, each: So many of each so many buffers; `salt`: which, if at random.
    """

    span: Span
    of: str
    counted: bool
    lost: int
    each: int
    salt: int

    def takes(self, place: int, k: int) -> bool:
        """True for the buffer at this place, with the camera's field `k`, if it comes in the span."""
        if self.of == "at random":
            return random.Random(self.salt + place).randrange(self.each) < self.lost
        if self.of == "one parity":
            return (k + self.salt) % 2 == 0
        return self.of == "all" or place % self.each < self.lost


@dataclass
class Weather:
    """All that a run's camera, driver and computer do; a row of the table sets some of it.

    Attributes:
        order, rate_hz: The stream; `rate_hz` as granted.
        ppm: By how much the camera is slow; `warm_ppm` more of it as it warms up, `wander_ppm` to and fro.
        shutter: Exposure, in periods.
        source: What a stamp is: `eof`, `soe`, `read` (taken as the program dequeues), `copy` or `unknown`.
        grid_ms: Ticks of the clock of the stamps; `clock_ppm`: by how much it is slow.
        usb_ms: Longest delay of a buffer on its way.
        late: Share of buffers that are stamped late, by `late_ms` on average.
        counts: `nothing`, `fields`, or `frames` whose two fields share a number.
        wraps, first_count: Where the count begins again, and with what it begins.
        restarts_at_0: Whether STREAMON sets it to 0.
        buffers: Of the queue.
        freezes, stands, busy: When the program does not run; when the whole computer does not, its drivers
            included; and when the program waits for a processor before each turn.
        losses: On the bus.
        bunches: When a hub holds back what comes.
        stalls, fails, unplugged, dark: Nothing comes; the stream fails; the grabber is gone; no signal.
        steps: When the clock of the stamps is set, and by how much.
        zeros, backs: When stamps are 0, and run backward.
        suspends: When CLOCK_MONOTONIC stands still; the camera goes on that many periods later or earlier.
        turns: When the camera goes on in the other phase.
        recounts: When the count begins anew.
        flagged, repeated, twice, swapped: Shares of buffers that are damaged, that have an old picture, that
            are handed over again, or after their successor.
        clear: False if something in it leaves honest doubt, whatever the program does.
    """

    order: FieldOrder = FieldOrder.TOP_FIRST
    rate_hz: float = 50.0
    ppm: float = 0.0
    warm_ppm: float = 0.0
    wander_ppm: float = 0.0
    shutter: float = 1.0
    source: str = "eof"
    grid_ms: float = 0.0
    clock_ppm: float = 0.0
    usb_ms: float = 0.5
    late: float = 0.0
    late_ms: float = 25.0
    counts: str = "nothing"
    wraps: int = 2**32
    first_count: int = 0
    restarts_at_0: bool = True
    buffers: int = 8
    freezes: list[Span] = field(default_factory=list)
    stands: list[Span] = field(default_factory=list)
    busy: list[Span] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    bunches: list[Span] = field(default_factory=list)
    stalls: list[Span] = field(default_factory=list)
    fails: list[Span] = field(default_factory=list)
    unplugged: list[Span] = field(default_factory=list)
    dark: list[Span] = field(default_factory=list)
    steps: list[Span] = field(default_factory=list)
    zeros: list[Span] = field(default_factory=list)
    backs: list[Span] = field(default_factory=list)
    suspends: list[Span] = field(default_factory=list)
    turns: list[Span] = field(default_factory=list)
    recounts: list[Span] = field(default_factory=list)
    flagged: float = 0.0
    repeated: float = 0.0
    twice: float = 0.0
    swapped: float = 0.0
    clear: bool = True

    @property
    def period_ns(self) -> float:
        """Time from field to field, as granted."""
        return S / self.rate_hz

    @property
    def per_buffer(self) -> int:
        """Fields of a buffer."""
        return 2 if self.order in WOVEN else 1


class Buffer(NamedTuple):
    """A filled buffer.

    Attributes:
        first: Camera's number of its older field.
        shown: That of the field whose picture it has.
        done_ns: When the driver hands it over.
        stamp_ns, sequence, flags: As VIDIOC_DQBUF gives them; the stamp without those of `read`.
        again: True if it was handed over before.
    """

    first: int
    shown: int
    done_ns: int
    stamp_ns: int
    sequence: int
    flags: int
    again: bool = False


_EDGE = 0.4
"""Periods after all buffers were full within which a field that is lost may as well have found none."""
_REQUEST = 3
"""Periods for which the program waits for a field, and half of one that passes unnoticed."""
_WARMS_S, _WANDERS_S, _HOST_MS = 60.0, 47.0, 0.3
_SOURCE_FLAGS = {"soe": abi.BUF_FLAG_TSTAMP_SRC_SOE, "copy": 0x4000, "unknown": 0}


class Camera:
    """When each field is exposed: that is all that a camera does."""

    def __init__(self, weather: Weather, begin_ns: int, phase: float) -> None:
        self._weather, self._begin_ns, self._phase = weather, begin_ns, phase

    def middle_ns(self, k: int) -> int:
        """Middle of the exposure of field `k`."""
        w = self._weather
        s = (k + self._phase) / w.rate_hz
        warm = w.warm_ppm * (s - _WARMS_S * (1 - math.exp(-s / _WARMS_S)))
        turn = 2 * math.pi / _WANDERS_S
        off_us = w.ppm * s + warm + w.wander_ppm / turn * math.sin(turn * s)
        shifted = sum(one.amount for one in w.suspends if s >= one.begin_s) * w.period_ns
        return self._begin_ns + round(s * S + off_us * 1000 + shifted)

    def parity(self, k: int) -> int:
        """Parity of field `k`; 0 is the top."""
        s = k / self._weather.rate_hz
        return (k + sum(s >= one.begin_s for one in self._weather.turns)) % 2


class Driver:
    """The kernel driver's queue of buffers, from the camera's field `next_k` on.

    Attributes:
        filled: Buffers that wait to be dequeued.
        free: Number of those that may be filled.
        fate: Of each of the camera's fields that was not delivered: what may be blamed for it.
    """

    def __init__(self, weather: Weather, camera: Camera, begin_ns: int, random_: random.Random) -> None:
        self._w, self._camera, self._begin_ns, self._random = weather, camera, begin_ns, random_
        self.filled: deque[Buffer] = deque()
        self.free = 0
        self.fate: dict[int, Causes] = {}
        self._streams = False
        self._place = 0
        self._skipped = weather.order is FieldOrder.BOTTOM_FIRST
        self._count = weather.first_count
        self._recounted = 0
        self._coming = self._units()
        self._next = next(self._coming)
        self._finds_one: bool | None = None
        self._freed_ns = 0
        self._at_the_edge = False
        self._shown: dict[int, int] = {}

    def stream_on(self, now_ns: int) -> None:
        """VIDIOC_STREAMON: all buffers are queued, and the count begins at zero."""
        self.run_until(now_ns)
        self.filled.clear()
        self.free, self._streams, self._finds_one = self._w.buffers, True, None
        if self._w.restarts_at_0:
            self._count = 0

    def stream_off(self, now_ns: int) -> None:
        """VIDIOC_STREAMOFF: whatever waits is dropped."""
        self.run_until(now_ns)
        for buffer in self.filled:
            self.lose(buffer.first, DEVICE)
        self.filled.clear()
        self._shown.clear()
        self._streams = False

    def run_until(self, now_ns: int) -> None:
        """Fills buffers with all that has come."""
        while self.next_ns <= now_ns:
            if self._finds_one is None:
                self._at_the_edge = self.next_ns - self._freed_ns < _EDGE * self._w.period_ns
                self._finds_one = self.free > 0
            else:
                self._arrive(self._next, has_buffer=self._finds_one)
                self._next, self._finds_one = next(self._coming), None

    def give_back(self, now_ns: int) -> None:
        """VIDIOC_QBUF."""
        self.run_until(now_ns)
        if not self.free:
            self._freed_ns = now_ns
        self.free += 1

    @property
    def next_ns(self) -> int:
        """When the next buffer's worth begins to come, for which the driver needs a free one, or has come."""
        lasts_ns = 0 if self._finds_one is not None else round(self._w.per_buffer * self._w.period_ns)
        return self._next.done_ns - lasts_ns

    def _units(self) -> Iterator[Buffer]:
        """All that comes from the camera, by time."""
        w, each, done_ns = self._w, self._w.per_buffer, 0
        while True:
            first = self._place * each + self._skipped
            middle_ns = self._camera.middle_ns(first + each - 1)
            read_out_ns = middle_ns + (w.shutter / 2 + 1) * w.period_ns
            come_ns = read_out_ns + (_HOST_MS + self._random.uniform(0, w.usb_ms)) * MS
            done_ns = max(done_ns + 1, self._released_ns(round(come_ns)))
            yield Buffer(first, first, done_ns, round(come_ns), 0, 0)
            self._place += 1

    def _released_ns(self, come_ns: int) -> int:
        at_s = self._s(come_ns)
        return next((self._begin_ns + round(b.end_s * S) for b in self._w.bunches if at_s in b), come_ns)

    def _s(self, time_ns: int) -> float:
        return (time_ns - self._begin_ns) / S

    def _arrive(self, buffer: Buffer, *, has_buffer: bool) -> None:
        """A buffer's worth of fields reaches the driver, or does not."""
        at_s = self._s(buffer.done_ns)
        taking = (one for one in self._w.losses if one.takes(self._place, buffer.first))
        loss = next((one for one in taking if at_s in one.span), None)
        lost = self._lost_because(at_s, loss)
        unnoticed = self._w.counts == "nothing" if loss is None else not loss.counted
        self._step_count(buffer.first, at_s, lost is not None and unnoticed)
        if lost is not None:
            # What finds no free buffer is lost to the computer, whatever else would have become of it.
            also_by_computer = self._at_the_edge or (self._streams and not has_buffer)
            self.lose(buffer.first, lost | COMPUTER if also_by_computer else lost)
        elif not has_buffer:
            bunched = any(b.begin_s <= at_s <= b.end_s + 0.5 for b in self._w.bunches)
            self.lose(buffer.first, COMPUTER | CABLE if bunched else COMPUTER)
        else:
            self._fill(buffer, at_s)

    def _lost_because(self, at_s: float, loss: Loss | None) -> Causes | None:
        w = self._w
        if not self._streams or any(at_s in one for one in (*w.stalls, *w.fails, *w.unplugged)):
            return DEVICE
        if any(at_s in one for one in w.dark):
            return CAMERA
        if stood := [one for one in w.stands if at_s in one]:
            # Within one request, nothing tells it from a grabber that sends nothing.
            in_a_request = all(one.end_s - one.begin_s < _REQUEST / w.rate_hz for one in stood)
            return COMPUTER | CABLE if in_a_request else COMPUTER
        return CABLE if loss else None

    def _step_count(self, first: int, at_s: float, unnoticed: bool) -> None:
        passed = sum(at_s >= one.begin_s for one in self._w.recounts)
        if passed > self._recounted:
            self._recounted, self._count = passed, 0
        elif not unnoticed and (self._w.counts != "frames" or self._camera.parity(first) == 0):
            self._count += 1  # a frame begins with its top field

    def _fill(self, buffer: Buffer, at_s: float) -> None:
        w, chance = self._w, self._random
        repeats = chance.random() < w.repeated
        flags = abi.BUF_FLAG_ERROR * (chance.random() < w.flagged)
        flags |= _SOURCE_FLAGS.get(w.source, 0) | abi.BUF_FLAG_TIMESTAMP_MONOTONIC * (
            w.source not in ("copy", "unknown")
        )
        filled = buffer._replace(
            shown=self._shown.get(buffer.first % 2, buffer.first) if repeats else buffer.first,
            stamp_ns=self._stamp_ns(buffer, at_s),
            sequence=self._count % w.wraps,
            flags=flags,
        )
        self._shown[buffer.first % 2] = filled.shown
        if self.filled and chance.random() < w.swapped:
            self.filled.insert(len(self.filled) - 1, filled)
        else:
            self.filled.append(filled)
        self.free -= 1
        if self.free and chance.random() < w.twice:
            self.filled.append(filled._replace(again=True))
            self.free -= 1

    def _stamp_ns(self, buffer: Buffer, at_s: float) -> int:
        w = self._w
        stamp_ns = buffer.stamp_ns
        if w.source == "soe":
            stamp_ns = round(self._camera.middle_ns(buffer.first) - w.shutter / 2 * w.period_ns)
        if self._random.random() < w.late:
            stamp_ns += round(self._random.expovariate(1 / w.late_ms) * MS)
        return self.by_its_clock(stamp_ns, at_s)

    def by_its_clock(self, time_ns: int, at_s: float) -> int:
        """What the clock of the stamps shows at a time."""
        w = self._w
        if any(at_s in one for one in w.zeros):
            return 0
        back_s = sum(2 * (at_s - one.begin_s) for one in w.backs if at_s in one)
        set_s = sum(one.amount for one in w.steps if at_s >= one.begin_s)
        shown_ns = round(time_ns + (set_s - back_s - at_s * w.clock_ppm / 1e6) * S)
        return shown_ns - shown_ns % max(round(w.grid_ms * MS), 1)

    def lose(self, first: int, because: Causes) -> None:
        """Notes why the fields of a buffer were not delivered."""
        for k in range(first, first + self._w.per_buffer):
            self.fate[k] = because

    def losses(self, first: int, end: int) -> Counter[Causes]:
        """What became of the fields from `first` to before `end` that were not delivered."""
        return Counter(self.fate[k] for k in range(first, end) if k in self.fate)
