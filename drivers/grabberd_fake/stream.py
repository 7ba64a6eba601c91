"""The simulated driver's buffers: which fields wait in them, and what they hold."""

from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd_fake.faults import (
    Bunch,
    ClockStep,
    Damage,
    NoSignal,
    Recount,
    Repeat,
    Script,
    Shift,
    Short,
    Timestamp,
    Turn,
)
from grabberd_fake.optics import COLUMNS, LINES
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.world import random_of

# Luma of Rec. 601 blue and black, and of the eight colour bars.
_NO_SIGNAL_LUMA = {"blue": 41, "black": 16}
_BARS_LUMA = np.array([235, 210, 170, 145, 106, 81, 41, 16], np.uint8)


class Pictures(Protocol):
    """Pictures of a world: a `World` that draws them when they are asked for, or one that draws ahead.

    Attributes:
        waited_ns: time spent so far in waiting for pictures that should have been drawn before.
    """

    waited_ns: int

    def picture(self, field: int, out: NDArray[np.uint8]) -> None:
        """Writes the luma of the camera's field number `field` into `out`, (288, 720) or (576, 720)."""
        ...


class Stream:
    """The driver's buffers between one open and close.

    Attributes:
        rows: rows of each field.
        origin: camera field with which the script begins.
    """

    def __init__(
        self, world: Pictures, script: Script, options: FakeOptions, origin: int, first: int, rows: int
    ) -> None:
        self.rows = rows
        self.origin = origin
        self._world, self._script, self._driver = world, script, options.driver
        self._seed = options.seed
        self._each = options.driver.a_buffer
        self._period_ns, self._arrival_ns = options.driver.period_ns, options.driver.arrival_ns
        self._first = self._next = first + (options.driver.order == "bottom_first")
        self._waiting: deque[int] = deque()
        self._free = options.buffers
        self._newest_stamp_ns = -1
        lumas = options.buffers * self._each
        shape = (LINES if options.driver.is_progressive else ROWS, COLUMNS)
        self._lumas = deque(np.empty(shape, np.uint8) for _ in range(lumas))

    def catch_up(self, now_ns: int) -> None:
        """Fills free buffers with what has arrived; without a free buffer a field or frame is lost."""
        newest = self._newest_arrived(now_ns)
        while self._next + self._each - 1 <= newest and self._free:
            if self._delivers(self._next):
                self._waiting.append(self._next)
                self._free -= 1
            self._next += self._each
        behind = newest + 1 - self._next
        self._next += max(behind // self._each * self._each, 0)

    def _newest_arrived(self, now_ns: int) -> int:
        newest = (now_ns - self._arrival_ns) // self._period_ns
        bunch = self._script.at(newest - self.origin, Bunch)
        return newest if bunch is None else self.origin + bunch.first - 1

    def _delivers(self, first: int) -> bool:
        members = range(first, first + self._each)
        return all(self._script.delivers(field - self.origin) for field in members)

    def has_field(self) -> bool:
        """True if a field is waiting."""
        return bool(self._waiting)

    def next_arrival_ns(self) -> int:
        """Time at which the next field or frame is due."""
        field = self._next + self._each - 1
        bunch = self._script.at(field - self.origin, Bunch)
        if bunch is not None:
            field = self.origin + bunch.first + bunch.fields
        return field * self._period_ns + self._arrival_ns

    def take(self, now_ns: int) -> list[GrabbedField]:
        """The oldest waiting field or the fields of a frame; their buffer stays taken until `give_back`.

        The picture is drawn only now: one that is lost or skipped costs nothing.
        """
        first = self._waiting.popleft()
        members = range(first, first + self._each)
        stamp_ns = self._stamp_ns(members[-1], now_ns)
        return [self._grabbed(field, stamp_ns - (members[-1] - field) * self._period_ns) for field in members]

    def give_back(self) -> None:
        """Marks a buffer as free again."""
        self._free += 1

    def _grabbed(self, field: int, stamp_ns: int) -> GrabbedField:
        number = field - self.origin
        luma = self._lumas[0]
        self._lumas.rotate(-1)
        self._draw(field, number, luma)
        damage = "the driver flags an error" if self._script.at(number, Damage) else None
        parity = (field + len(self._script.before(number, Turn))) % 2
        rows = luma[: self.rows]
        picture = Field.progressive(rows) if self._driver.is_progressive else Field.intact(rows, parity)
        return GrabbedField(picture, self._time_ns(number, stamp_ns), self._sequence(field), damage)

    def _sequence(self, field: int) -> int | None:
        if self._driver.counts == "nothing":
            return None
        recounts = self._script.before(field - self.origin, Recount)
        if recounts:
            first, count = self.origin + recounts[-1].first, recounts[-1].count
        else:
            first, count = self._first, -self._script.wraps_after()
        passed = self._script.uncounted(field - self.origin) - self._script.uncounted(first - self.origin)
        counted = field - first - passed
        return (count + (counted // 2 if self._driver.counts == "frames" else counted)) % 2**32

    def _stamp_ns(self, field: int, now_ns: int) -> int:
        """Timestamp of a buffer whose last field this is: never earlier than that of the one before."""
        if self._driver.stamps == "arrival":
            return now_ns - self._arrival_ns
        chance = random_of(self._seed, field)
        late_ns = chance.uniform(0.0, self._driver.jitter_ms) * 1e6
        if chance.random() < self._driver.late:
            late_ns += chance.exponential(self._driver.late_ms) * 1e6
        self._newest_stamp_ns = max(field * self._period_ns + round(late_ns), self._newest_stamp_ns + 1)
        return self._newest_stamp_ns

    def _time_ns(self, number: int, stamp_ns: int) -> int:
        steps = self._script.before(number, ClockStep)
        stamp_ns += sum(round(step.by_s * 1e9) for step in steps)
        wrong = self._script.at(number, Timestamp)
        return stamp_ns if wrong is None else wrong.time_ns(number, stamp_ns)

    def _draw(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        no_signal = self._script.at(number, NoSignal)
        if no_signal is not None:
            _draw_no_signal(no_signal.picture, random_of(self._seed, field), luma)
            return
        repeat = self._script.at(number, Repeat)
        self._world.picture(self.origin + repeat.first - 1 if repeat else field, luma)
        self._spoil(field, number, luma)

    def _spoil(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        stale = self._script.at(number, Short) or self._script.at(number, Damage)
        if stale is not None:
            luma[stale.row :] = self._lumas[-2][stale.row :]  # as the buffer before was handed over
        shift = self._script.at(number, Shift)
        if shift is not None:
            luma[shift.row :] = np.roll(luma[shift.row :], shift.shift_px)


def _draw_no_signal(picture: str, rng: np.random.Generator, luma: NDArray[np.uint8]) -> None:
    if picture == "noise":
        luma[:] = rng.integers(0, 256, luma.shape, dtype=np.uint8)
    elif picture == "bars":
        luma[:] = np.repeat(_BARS_LUMA, COLUMNS // len(_BARS_LUMA))
    else:
        luma[:] = _NO_SIGNAL_LUMA[picture]
