"""The simulated grabber, seen through the driver contract."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition.device import FieldOrder, GrabbedField, Signal, StreamInfo
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused
from grabberd.field import Field
from grabberd_fake.clock import Clock, JumpingClock, RealClock
from grabberd_fake.faults import PERIOD_NS, Damage, NoSignal, Repeat, Script, Shift, Short, Unplug
from grabberd_fake.optics import COLUMNS
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.world import World

ARRIVAL_NS = PERIOD_NS // 2
"""From the middle of a field's exposure until the driver has it."""

_NO_SIGNAL_LUMA = {"blue": 41, "black": 16}
_REPLUG = "plug the grabber in again; it is tried again by itself"


class FakeGrabber:
    """A camera before a simulated scene, ALTERNATE, 50 fields a second; `FakeOptions` lists its options.

    Without options it is the reference rig before the pulsating liner, at real pace. `NOT_SIMULATED` says
    what it leaves out.
    """

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: what the world runs on; the machine's monotonic clock by default. With `pace: free` it
                gives the start only, and time passes with every field that is read.
            options: see `FakeOptions`.

        Raises:
            ValueError: a line for every key that is unknown or whose value is not allowed.
        """
        self.options = FakeOptions.read(options)
        self._clock = clock or RealClock()
        if self.options.pace == "free":
            self._clock = JumpingClock(self._clock.now_ns())
        self._script = Script(self.options.faults)
        self._world: World | None = None
        self._stream: _Stream | None = None
        self._first: int | None = None

    def open(self) -> StreamInfo:
        """Starts streaming with the next top field.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open already.
        """
        if self._stream is not None:
            raise DeviceRefused("the simulated grabber is open already", "close it first")
        self._start(self._refuse_if_unplugged)
        return self._info()

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        """The next field; nothing if none comes in time.

        Raises:
            DeviceLost: the script unplugs it, or it is not open.
        """
        stream = self._wait(timeout_s)
        fields = [] if stream is None else [stream.take()]
        try:
            yield fields
        finally:
            if stream is not None and self._stream is stream:
                stream.catch_up(self._clock.now_ns())
                stream.give_back()

    def signal(self) -> Signal:
        """What the script says of now; unknown while it is not open."""
        if self._stream is None:
            return Signal.UNKNOWN
        lost = self._script.at(self._number_now(), NoSignal)
        return Signal.PRESENT if lost is None else Signal.ABSENT

    def restart(self) -> StreamInfo:
        """Streams anew from the next top field.

        Raises:
            DeviceLost: it is not open, or the script has it unplugged.
        """
        if self._stream is None:
            raise DeviceLost("the simulated grabber is not open", "open it first")
        self._start(self._check_plug)
        return self._info()

    def reset(self) -> None:
        """Does what pulling the plug would.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open.
        """
        if self._stream is not None:
            raise DeviceRefused("the simulated grabber is open", "close it first")
        self._refuse_if_unplugged()

    def close(self) -> None:
        """Lets go of the buffers."""
        self._stream = None

    def _start(self, check: Callable[[], None]) -> None:
        self._world = self._world or World(self.options)  # takes its time, so before the first field is due
        first = self._next_top_field()
        self._first = first if self._first is None else self._first
        check()
        self._stream = _Stream(self._world, self._script, self._first, first, self.options.buffers)

    def _next_top_field(self) -> int:
        return -(-self._clock.now_ns() // (2 * PERIOD_NS)) * 2

    def _number_now(self) -> int:
        """The last field that was due, counted from the first: the script's time."""
        return max((self._clock.now_ns() - ARRIVAL_NS) // PERIOD_NS - (self._first or 0), 0)

    def _refuse_if_unplugged(self) -> None:
        unplug = self._script.at(self._number_now(), Unplug)
        if unplug is None:
            return
        if self.options.pace == "free":  # its time passes for whoever waits, and trying again is waiting
            self._clock.sleep_until_ns(self._arrival_ns(unplug.first + unplug.fields))
        raise DeviceAbsent("there is no simulated grabber: the script has it unplugged", _REPLUG)

    def _arrival_ns(self, number: int) -> int:
        return ((self._first or 0) + number) * PERIOD_NS + ARRIVAL_NS

    def _wait(self, timeout_s: float) -> "_Stream | None":
        """The stream when it has a field waiting, None when the time is over."""
        if self._stream is None:
            raise DeviceLost("the simulated grabber is not open", "open it first")
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while True:
            now_ns = self._clock.now_ns()
            self._check_plug()
            self._stream.catch_up(now_ns)
            if self._stream.has_field():
                return self._stream
            if now_ns >= deadline_ns:
                return None
            self._clock.sleep_until_ns(min(self._stream.next_arrival_ns(), deadline_ns))

    def _check_plug(self) -> None:
        if self._script.at(self._number_now(), Unplug) is not None:
            raise DeviceLost("the simulated grabber is gone: the script has unplugged it", _REPLUG)

    def _info(self) -> StreamInfo:
        return StreamInfo(
            driver="fake",
            card="simulated grabber",
            standard="PAL",
            columns=COLUMNS,
            field_rows=ROWS,
            rate_hz=1e9 / PERIOD_NS,
            field_order=FieldOrder.ALTERNATE,
            pixel_format="GREY",
            buffers=self.options.buffers,
            live=self.options.pace == "real",
            waits_for_reader=self.options.pace == "free",
            counts_losses=self._script.counts_losses(),
            tells_signal=True,
            time_sigma_ns=1_000,
            details={"scene": self.options.scene, "pace": self.options.pace},
        )


class _Stream:
    """The driver's buffers between one open and close: which fields wait in them, and what they hold."""

    def __init__(self, world: World, script: Script, origin: int, first: int, buffers: int) -> None:
        self._world, self._script, self._origin = world, script, origin
        self._first = self._next = first
        self._waiting: deque[int] = deque()
        self._free = buffers
        self._lumas = deque(np.empty((ROWS, COLUMNS), np.uint8) for _ in range(buffers))

    def catch_up(self, now_ns: int) -> None:
        """Fills the free buffers with what has arrived; what finds none is lost."""
        newest = (now_ns - ARRIVAL_NS) // PERIOD_NS
        while self._next <= newest and self._free:
            if self._script.delivers(self._next - self._origin):
                self._waiting.append(self._next)
                self._free -= 1
            self._next += 1
        self._next = max(self._next, newest + 1)

    def has_field(self) -> bool:
        """Whether a field waits."""
        return bool(self._waiting)

    def next_arrival_ns(self) -> int:
        """When the next field is due."""
        return self._next * PERIOD_NS + ARRIVAL_NS

    def take(self) -> GrabbedField:
        """The oldest field that waits; its buffer stays taken until `give_back`. It is drawn only now."""
        field = self._waiting.popleft()
        number = field - self._origin
        luma = self._lumas[0]
        self._lumas.rotate(-1)
        self._draw(field, number, luma)
        damage = "the driver flags an error" if self._script.at(number, Damage) else None
        return GrabbedField(Field.intact(luma, field % 2), field * PERIOD_NS, self._sequence(field), damage)

    def give_back(self) -> None:
        """A buffer is free again."""
        self._free += 1

    def _sequence(self, field: int) -> int:
        passed = self._script.uncounted(field - self._origin) - self._script.uncounted(
            self._first - self._origin
        )
        return (field - self._first - passed) % 2**32

    def _draw(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        no_signal = self._script.at(number, NoSignal)
        if no_signal is not None:
            _draw_no_signal(no_signal.picture, self._world.random(field), luma)
            return
        repeat = self._script.at(number, Repeat)
        self._world.picture(self._origin + repeat.first - 1 if repeat else field, luma)
        self._spoil(field, number, luma)

    def _spoil(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        stale = self._script.at(number, Short) or self._script.at(number, Damage)
        if stale is not None:
            before = np.empty_like(luma)
            self._world.picture(field - 1, before)
            luma[stale.row :] = before[stale.row :]
        shift = self._script.at(number, Shift)
        if shift is not None:
            luma[shift.row :] = np.roll(luma[shift.row :], shift.shift_px, axis=1)


def _draw_no_signal(picture: str, rng: np.random.Generator, luma: NDArray[np.uint8]) -> None:
    if picture == "noise":
        luma[:] = rng.integers(0, 256, luma.shape, dtype=np.uint8)
    else:
        luma[:] = _NO_SIGNAL_LUMA[picture]
