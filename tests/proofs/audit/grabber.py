"""The grabber of a run, to the program: what VIDIOC_DQBUF would give, converted as the V4L2 driver does."""

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from simulated_time import SimulatedClock

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, FieldOrder
from grabberd.errors import DeviceAbsent, DeviceLost, StreamFailed
from grabberd.instrument.acquisition.device import GrabbedField, Signal, StreamInfo
from grabberd.instrument.device.scheduling import ThreadTimes
from grabberd_v4l2.abi import BUF_FLAG_ERROR, Arrangement
from grabberd_v4l2.fields import FieldTimes, Granted, LaidField, Layout, Stamp
from grabberd_v4l2.formats import Scan
from grabberd_v4l2.grabber import stream_info
from grabberd_v4l2.node import Capability
from grabberd_v4l2.profiles import Profile

from .world import CABLE, MS, WOVEN, Buffer, Camera, Driver, S, Span, Weather

_ARRANGEMENTS = {
    FieldOrder.ALTERNATE: Arrangement.ALTERNATE,
    FieldOrder.TOP_FIRST: Arrangement.INTERLACED_TB,
    FieldOrder.BOTTOM_FIRST: Arrangement.INTERLACED_BT,
    FieldOrder.PROGRESSIVE: Arrangement.NONE,
}
ROWS, COLUMNS, _TURN_MS = 6, 64, 0.05
_NOISE = np.random.default_rng(0).integers(0, 256, (ROWS, COLUMNS), np.uint8)
"""Pictures are numbers: the camera's own in each row, before the same noise, so that none is like another."""


class Handed(NamedTuple):
    """A field as the program was given it.

    Attributes:
        k: The camera's number; None if it is none of its fields, but an old one again.
        shown: That of its picture.
        flagged: True if its driver said that it is damaged.
        at_ns: When.
    """

    k: int | None
    shown: int
    flagged: bool
    at_ns: int


class AuditedGrabber:
    """Camera, driver and computer of a run; also the kernel's account of the program.

    Attributes:
        handed: All fields that the program was given.
    """

    called_ns, waited_ns = 0, 0

    def __init__(self, weather: Weather, clock: SimulatedClock, seed: int) -> None:
        self._w, self._clock, self._begin_ns = weather, clock, clock.ns
        self._chance = random.Random(seed)
        self.camera = Camera(weather, clock.ns, self._chance.random())
        self.driver = Driver(weather, self.camera, clock.ns, self._chance)
        self.handed: list[Handed] = []
        self.found_empty = False
        self._open = False
        self._failed_at_s = 0.0
        older = PROGRESSIVE if weather.order is FieldOrder.PROGRESSIVE else TOP
        older = BOTTOM if weather.order is FieldOrder.BOTTOM_FIRST else older
        lines = ROWS * (2 if weather.order in WOVEN else 1)
        arrangement = _ARRANGEMENTS[weather.order]
        granted = Granted(
            COLUMNS, lines, COLUMNS, "GREY", arrangement, "PAL", Capability("audited", "card", "bus", 0),
            weather.buffers, Scan(2 * ROWS if older != PROGRESSIVE else ROWS, weather.rate_hz, older),
        )  # fmt: skip
        self._profile = Profile(
            driver="audited",
            field_orders=(arrangement.name.lower(),),
            trusts_sequence=weather.counts != "nothing",
            time_sigma_ms=max(weather.grid_ms, weather.usb_ms, 1.0),
        )
        self._layout = Layout.of(granted, self._profile)
        self._times = FieldTimes(self._layout, self._profile)

    def open(self) -> StreamInfo:
        """Opens and starts the stream."""
        if self._is(self._w.unplugged):
            raise DeviceAbsent("it is unplugged", "plug it in")
        self._open = True
        return self.restart()

    def restart(self) -> StreamInfo:
        """VIDIOC_STREAMOFF and VIDIOC_STREAMON."""
        self._check()
        self.driver.stream_off(self._clock.ns)
        self.driver.stream_on(self._clock.ns)
        self._times = FieldTimes(self._layout, self._profile)
        tells = self._w.dark != []
        return stream_info(self._layout, self._profile, self._times, tells, Path("/dev/video0"), ())

    def reset(self) -> None:
        """It comes back by itself."""

    def close(self) -> None:
        """Closes it."""
        self.driver.stream_off(self._clock.ns)
        self._open = False

    def signal(self) -> Signal:
        """As VIDIOC_ENUMINPUT has it."""
        return Signal.ABSENT if self._is(self._w.dark) else Signal.PRESENT

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        """The next buffer, when the computer lets the program run."""
        self._wait_for_turn()
        self._check()
        buffer = self._wait(self._clock.ns + round(timeout_s * S))
        try:
            yield [] if buffer is None else self._fields(buffer)
        finally:
            if buffer is not None:
                self.driver.give_back(self._clock.ns)

    def _wait(self, deadline_ns: int) -> Buffer | None:
        driver, clock = self.driver, self._clock
        driver.run_until(clock.ns)
        self.found_empty = not driver.filled
        while not driver.filled and clock.ns < deadline_ns:
            clock.ns = min(driver.next_ns, deadline_ns)
            driver.run_until(clock.ns)
            if driver.filled or clock.ns >= deadline_ns:
                self._wait_for_turn()
                driver.run_until(clock.ns)
            self._check()
        return driver.filled.popleft() if driver.filled else None

    def _wait_for_turn(self) -> None:
        """Lets the time pass for which the computer does not let the program run."""
        before_ns, at_s = self._clock.ns, self._s()
        for freeze in (*self._w.freezes, *self._w.stands):
            if self._s() in freeze:
                self._clock.ns = self._begin_ns + round(freeze.end_s * S)
        mean_ms = next((busy.amount for busy in self._w.busy if at_s in busy), 0.0)
        waited_ns = round(self._chance.expovariate(1 / (mean_ms or _TURN_MS)) * MS)
        self.waited_ns += waited_ns if self._clock.ns == before_ns else 0
        self._clock.ns += waited_ns

    def _check(self) -> None:
        if not self._open or self._is(self._w.unplugged):
            self._open = False
            raise DeviceLost("it is unplugged", "plug it in")
        if self._is(self._w.fails):
            raise StreamFailed("the stream has failed", "wait")

    def _s(self) -> float:
        return (self._clock.ns - self._begin_ns) / S

    def _is(self, spans: list[Span]) -> bool:
        return bool(spans) and any(self._s() in span for span in spans)

    def _fields(self, buffer: Buffer) -> list[GrabbedField]:
        stamp_ns = buffer.stamp_ns
        if self._w.source == "read":
            stamp_ns = self.driver.by_its_clock(self._clock.ns, self._s())
        stamp = Stamp(stamp_ns, buffer.flags, buffer.sequence, self._clock.ns)
        if self._times.handed_back(stamp):
            self.driver.lose(buffer.first, CABLE)
            return []
        each, flagged = self._w.per_buffer, bool(buffer.flags & BUF_FLAG_ERROR)
        laid = [self._laid(buffer.first + i, buffer.shown + i, each - 1 - i) for i in range(each)]
        for i in range(each):
            k = None if buffer.again else buffer.first + i
            self.handed.append(Handed(k, buffer.shown + i, flagged, self._clock.ns))
        damage = "the driver flags an error" if flagged else None
        return [
            GrabbedField(one.field, time.time_ns, time.sequence, damage)
            for one, time in zip(laid, self._times.of(stamp, laid), strict=True)
        ]

    def _laid(self, k: int, shown: int, age: int) -> LaidField:
        luma = _NOISE.copy()
        luma[:, :8].view(np.int64)[:] = shown
        parity = PROGRESSIVE if self._w.order is FieldOrder.PROGRESSIVE else self.camera.parity(k)
        return LaidField(luma, parity, age, slice(None))

    def thread(self) -> ThreadTimes:
        """Times of the capture thread."""
        return ThreadTimes(0, self.waited_ns)

    def program_ns(self) -> int:
        """Processor time of the program, which nothing takes in simulated time."""
        return 0

    def come_first(self) -> str:
        """Nobody else is there."""
        return ""

    def keep_to_share(self, now_ns: int) -> str:
        """It takes no share."""
        return ""
