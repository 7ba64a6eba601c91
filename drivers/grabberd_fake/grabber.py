"""The simulated grabber, seen through the driver contract."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from grabberd.core.field import FieldOrder
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition.device import GrabbedField, Signal, StreamInfo
from grabberd_fake import faults
from grabberd_fake.optics import COLUMNS
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.stage import REARRANGED, Stage
from grabberd_fake.stream import DrawnAhead, Pictures, Stream
from grabberd_fake.world import World

_NTSC_ROWS = 240
# A field number that no run reaches, and that arithmetic with numbers still fits into 64 bits.
_NEVER = 2**62
_REFUSALS = {
    "busy": ("another program has it", "end that program", Cause.DEVICE_BUSY),
    "rights": ("it may not be opened", "add the user to the group that owns it", Cause.NO_RIGHTS),
    "bandwidth": ("the bus has no room for its stream", "plug it into a bus of its own", Cause.NO_BANDWIDTH),
}
_ORDERS = {
    "alternate": FieldOrder.ALTERNATE,
    "top_first": FieldOrder.TOP_FIRST,
    "bottom_first": FieldOrder.BOTTOM_FIRST,
    "progressive": FieldOrder.PROGRESSIVE,
}
_REPLUG = "plug the grabber in again; grabberd retries automatically"


class Clock(Protocol):
    """CLOCK_MONOTONIC or a simulated substitute."""

    def now_ns(self) -> int:
        """Current time in ns."""
        ...

    def sleep_until_ns(self, time_ns: int) -> None:
        """Returns at `time_ns`; at once if it has passed."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def sleep_until_ns(self, time_ns: int) -> None:
        """Sleeps."""
        time.sleep(max(time_ns - self.now_ns(), 0) / 1e9)


class JumpingClock:
    """A clock that advances only when somebody sleeps, by jumping to the end of the sleep."""

    def __init__(self, now_ns: int = 0) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Present time of the clock, in ns."""
        return self._now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        """Jumps forward, never back."""
        self._now_ns = max(self._now_ns, time_ns)


class FakeGrabber:
    """A camera before a simulated scene; `FakeOptions` lists its options.

    Without options it is the reference rig before the pulsating liner, at real pace. `NOT_SIMULATED` lists
    what it leaves out.
    """

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock of the simulated world; the machine's monotonic clock by default. With `pace: free`
                it gives only the start, and time advances with every field that is read.
            options: see `FakeOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        self.options = FakeOptions.read(options)
        self._stage = Stage(self.options.stage, self.options.liner)
        self._clock = clock or RealClock()
        if self.options.pace == "free":
            self._clock = JumpingClock(self._clock.now_ns())
        self._script = faults.Script(self.options.faults, self.options.driver.rate_hz)
        self._draws_ahead = clock is None and self.options.pace == "real"
        self._pictures: Pictures | None = None
        self._waited_ns = 0
        self._stream: Stream | None = None
        self._origin: int | None = None
        self._chance = np.random.default_rng(self.options.seed)
        self.found_empty = False

    @property
    def called_ns(self) -> int:
        """Time spent in waiting for pictures that were not drawn in time."""
        return self._waited_ns + (0 if self._pictures is None else self._pictures.waited_ns)

    def open(self) -> StreamInfo:
        """Starts streaming with the next top field.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open already, the script refuses it, or there is no stage.
        """
        if self._stream is not None:
            raise DeviceRefused("the simulated grabber is open already", "close it first")
        self._clear_faults("reopen")
        self._start(self._check_opening)
        return self._info()

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        """The next field, or those of the next frame; empty if none arrives in time.

        Raises:
            DeviceLost: the script unplugs it, or it is not open.
            StreamFailed: the script makes the stream fail, or something else is on stage now.
        """
        self._pause_program()
        stream = self._wait(timeout_s)
        try:
            fields = [] if stream is None else stream.take(self._clock.now_ns())
        except StreamFailed:
            self._waited_ns, self._pictures = self.called_ns, None  # a new process from the next start on
            raise
        try:
            yield fields
        finally:
            if stream is not None and self._stream is stream:
                # Fields that arrived while the caller held this buffer are queued before it is free again:
                # a slow reader has to lose fields as it would with real buffers.
                stream.catch_up(self._clock.now_ns())
                stream.give_back()

    def signal(self) -> Signal:
        """Signal at this moment according to the script; unknown while closed."""
        if self._stream is None:
            return Signal.UNKNOWN
        number = self._number_now()
        lost = self._script.at(number, faults.NoSignal)
        absent = self._script.at(number, faults.DeadInput) or (lost and lost.told)
        return Signal.ABSENT if absent else Signal.PRESENT

    def restart(self) -> StreamInfo:
        """Restarts the stream from the next top field.

        Raises:
            DeviceLost: it is not open, or the script has it unplugged.
            StreamFailed: the script makes it fail.
            DeviceRefused: the script has changed the standard.
        """
        if self._stream is None:
            raise DeviceLost("the simulated grabber is not open", "open it first")
        self._check_plug()
        if self._rows_now() != self._stream.rows:
            raise DeviceRefused("the standard has changed: other pictures would come", "open it again")
        self._clear_faults("restart")
        self._start(self._check_stream)
        return self._info()

    def reset(self) -> None:
        """Resets the device as pulling its plug would.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open.
        """
        if self._stream is not None:
            raise DeviceRefused("the simulated grabber is open", "close it first")
        self._refuse_if_unplugged()
        self._clear_faults("reset")

    def close(self) -> None:
        """Releases the buffers."""
        self._stream = None

    def _start(self, check: Callable[[], None]) -> None:
        self._stage.follow()
        if self._stage.liner != self.options.liner:
            self.options = replace(self.options, liner=self._stage.liner)
            self._waited_ns, self._pictures = self.called_ns, None
        # Takes long, so it comes before the first field is due.
        if self._pictures is None:
            self._pictures = DrawnAhead(self.options) if self._draws_ahead else World(self.options)
        first = self._next_top_field()
        if self._origin is None and self.options.cue is None:
            self._origin = first
        check()
        self._stream = Stream(
            self._pictures, self._script, self.options, self._begins_with(), first, self._rows_now()
        )

    def _begins_with(self) -> int:
        """Camera field with which the script begins; `_NEVER` before its cue."""
        cue = self.options.cue
        if self._origin is None and cue is not None and Path(cue).exists():
            self._origin = self._field_now() + 1
        return _NEVER if self._origin is None else self._origin

    def _clear_faults(self, step: str) -> None:
        self._script.clear(step, self._number_now())

    def _rows_now(self) -> int:
        rows = ROWS if self._script.at(self._number_now(), faults.Standard) is None else _NTSC_ROWS
        return 2 * rows if self.options.driver.is_progressive else rows

    def _next_top_field(self) -> int:
        return -(-self._clock.now_ns() // (2 * self.options.driver.period_ns)) * 2

    def _field_now(self) -> int:
        """Camera field that arrived last."""
        driver = self.options.driver
        return (self._clock.now_ns() - driver.arrival_ns) // driver.period_ns

    def _number_now(self) -> int:
        """Current field as the script counts: 0 before its first field, −1 before its cue."""
        origin = self._begins_with()
        return -1 if origin == _NEVER else max(self._field_now() - origin, 0)

    def _check_opening(self) -> None:
        self._refuse_if_unplugged()
        refuse = self._script.at(self._number_now(), faults.Refuse)
        if refuse is not None:
            self._let_pass(refuse)
            reason, hint, cause = _REFUSALS[refuse.why]
            raise DeviceRefused(f"the simulated grabber is refused: {reason}", hint, cause)

    def _refuse_if_unplugged(self) -> None:
        unplug = self._script.at(self._number_now(), faults.Unplug)
        if unplug is not None:
            self._let_pass(unplug)
            raise DeviceAbsent("there is no simulated grabber: the script has it unplugged", _REPLUG)

    def _let_pass(self, fault: faults.Fault) -> None:
        """At free pace, let time jump to the fault's end: a retry there is what waiting is in real time."""
        if self.options.pace == "free":
            self._clock.sleep_until_ns(self._arrival_ns(fault.first + fault.fields))

    def _arrival_ns(self, number: int) -> int:
        driver = self.options.driver
        return (self._begins_with() + number) * driver.period_ns + driver.arrival_ns

    def _wait(self, timeout_s: float) -> "Stream | None":
        """The stream once a field is waiting, or None after the timeout."""
        if self._stream is None:
            raise DeviceLost("the simulated grabber is not open", "open it first")
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        self.found_empty = False
        while True:
            now_ns = self._clock.now_ns()
            self._check_stream()
            self._stream.origin = self._begins_with()
            self._stream.catch_up(now_ns)
            if self._is_stormy():
                return None
            if self._stream.has_field():
                return self._stream
            self.found_empty = True
            if now_ns >= deadline_ns:
                return None
            self._clock.sleep_until_ns(min(self._stream.next_arrival_ns(), deadline_ns))

    def _is_stormy(self) -> bool:
        storm = self._script.at(self._number_now(), faults.Storm)
        if storm is not None:
            self._let_pass(storm)
        return storm is not None

    def _pause_program(self) -> None:
        """Lets the time pass for which the script does not let the program run."""
        number = self._number_now()
        if (freeze := self._script.at(number, faults.Freeze)) is not None:
            self._clock.sleep_until_ns(self._arrival_ns(freeze.first + freeze.fields))
        if (busy := self._script.at(number, faults.Busy)) is not None:
            late_ns = self._chance.exponential(busy.mean_ms) * 1e6
            self._clock.sleep_until_ns(self._clock.now_ns() + round(late_ns))

    def _check_plug(self) -> None:
        if self._script.at(self._number_now(), faults.Unplug) is not None:
            raise DeviceLost("the simulated grabber is gone: the script has unplugged it", _REPLUG)

    def _check_stream(self) -> None:
        self._check_plug()
        if self._script.at(self._number_now(), faults.Fail) is not None:
            raise StreamFailed("the simulated grabber's stream has failed", "the script says so")
        if self._stage.follow():
            raise StreamFailed(REARRANGED, "the stream begins again with what is on stage now")
        if self._stream is not None and self._rows_now() != self._stream.rows:
            raise StreamFailed("the camera's standard has changed", "the script says so")

    def _info(self) -> StreamInfo:
        assert self._stream is not None
        rows, driver = self._stream.rows, self.options.driver
        standard = "PAL" if rows == ROWS else "NTSC"
        return StreamInfo(
            driver="fake",
            card="simulated grabber",
            standard="" if driver.is_progressive else standard,
            columns=COLUMNS,
            field_rows=rows,
            rate_hz=driver.rate_hz,
            field_order=_ORDERS[driver.order],
            pixel_format="GREY",
            buffers=self.options.buffers * driver.a_buffer,
            live=self.options.pace == "real",
            waits_for_reader=self.options.pace == "free",
            counts_losses=driver.counts != "nothing" and self._script.counts_losses(),
            tells_signal=True,
            time_sigma_ns=max(1_000, round(driver.jitter_ms * 1e6)),
            details={
                "scene": self.options.scene,
                "pace": self.options.pace,
                "node": f"simulated{self._script.node(self._number_now())}",
                **({"stage": json.dumps(self._stage.content)} if self.options.stage is not None else {}),
            },
        )
