"""The simulated driver's buffers: which fields wait in them, and what they hold."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition.device import GrabbedField
from grabberd.field import Field
from grabberd_fake.faults import PERIOD_NS, Damage, NoSignal, Repeat, Shift, Short, Timestamp
from grabberd_fake.faults_script import Script
from grabberd_fake.optics import COLUMNS
from grabberd_fake.render import ROWS
from grabberd_fake.world import World

ARRIVAL_NS = PERIOD_NS // 2
"""Delay from the middle of a field's exposure to its arrival in the driver."""

# Luma of Rec. 601 blue and black, and of the eight colour bars.
_NO_SIGNAL_LUMA = {"blue": 41, "black": 16}
_BARS_LUMA = np.array([235, 210, 170, 145, 106, 81, 41, 16], np.uint8)


class Stream:
    """The driver's buffers between one open and close.

    Attributes:
        rows: rows of each field.
        origin: camera field with which the script begins.
    """

    def __init__(
        self, world: World, script: Script, origin: int, first: int, buffers: int, rows: int
    ) -> None:
        self.rows = rows
        self.origin = origin
        self._world, self._script = world, script
        self._first = self._next = first
        self._waiting: deque[int] = deque()
        self._free = buffers
        self._lumas = deque(np.empty((ROWS, COLUMNS), np.uint8) for _ in range(buffers))

    def catch_up(self, now_ns: int) -> None:
        """Fills free buffers with the fields that have arrived; without a free buffer a field is lost."""
        newest = (now_ns - ARRIVAL_NS) // PERIOD_NS
        while self._next <= newest and self._free:
            if self._script.delivers(self._next - self.origin):
                self._waiting.append(self._next)
                self._free -= 1
            self._next += 1
        self._next = max(self._next, newest + 1)

    def has_field(self) -> bool:
        """True if a field is waiting."""
        return bool(self._waiting)

    def next_arrival_ns(self) -> int:
        """Time at which the next field is due."""
        return self._next * PERIOD_NS + ARRIVAL_NS

    def take(self) -> GrabbedField:
        """The oldest waiting field; its buffer stays taken until `give_back`.

        The picture is drawn only now: one that is lost or skipped costs nothing.
        """
        field = self._waiting.popleft()
        number = field - self.origin
        luma = self._lumas[0]
        self._lumas.rotate(-1)
        self._draw(field, number, luma)
        damage = "the driver flags an error" if self._script.at(number, Damage) else None
        picture = Field.intact(luma[: self.rows], field % 2)
        return GrabbedField(picture, self._time_ns(field), self._sequence(field), damage)

    def give_back(self) -> None:
        """Marks a buffer as free again."""
        self._free += 1

    def _sequence(self, field: int) -> int:
        passed = self._script.uncounted(field - self.origin) - self._script.uncounted(
            self._first - self.origin
        )
        return (field - self._first - passed - self._script.wraps_after()) % 2**32

    def _time_ns(self, field: int) -> int:
        number, true_ns = field - self.origin, field * PERIOD_NS
        wrong = self._script.at(number, Timestamp)
        return true_ns if wrong is None else wrong.time_ns(number, true_ns)

    def _draw(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        no_signal = self._script.at(number, NoSignal)
        if no_signal is not None:
            _draw_no_signal(no_signal.picture, self._world.random(field), luma)
            return
        repeat = self._script.at(number, Repeat)
        self._world.picture(self.origin + repeat.first - 1 if repeat else field, luma)
        self._spoil(field, number, luma)

    def _spoil(self, field: int, number: int, luma: NDArray[np.uint8]) -> None:
        stale = self._script.at(number, Short) or self._script.at(number, Damage)
        if stale is not None:
            before = np.empty_like(luma)
            self._world.picture(field - 1, before)
            luma[stale.row :] = before[stale.row :]
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
