"""What a grabber does wrong, by script.

A fault holds for a window of camera fields, counted from the first field after the first `open`; the script
runs once, however often the grabber is opened again. A new kind is a dataclass and a line in `KINDS`.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from grabberd_fake.reading import choice, flag, integer, number

PERIOD_NS = 20_000_000
"""From field to field."""

FOREVER_S = 1e9


@dataclass(frozen=True)
class Fault:
    """One entry of the script.

    Attributes:
        at_s: seconds from the first field, or
        at_field: fields from the first field. Exactly one of the two is given.
    """

    at_s: float | None = number(None, 0, FOREVER_S, optional=True)
    at_field: int | None = integer(None, 0, 2**32, optional=True)
    delivers: ClassVar[bool] = True
    """Its fields reach the driver's buffers."""
    counted: ClassVar[bool] = True
    """The driver's sequence counts its fields."""

    @property
    def first(self) -> int:
        """Number of the first field it holds for."""
        return self.at_field if self.at_field is not None else math.ceil((self.at_s or 0.0) * 50 - 1e-9)

    @property
    def fields(self) -> int:
        """For how many fields it holds."""
        raise NotImplementedError

    def holds(self, number: int) -> bool:
        """Whether it holds for this field."""
        return self.first <= number < self.first + self.fields

    def check(self) -> Iterator[str]:
        """What is wrong with it."""
        if (self.at_s is None) == (self.at_field is None):
            yield "at_s: give either at_s or at_field"


@dataclass(frozen=True)
class Counted(Fault):
    """A fault of a number of fields; `count` of them."""

    count: int = integer(1, 1, 1_000_000)

    @property
    def fields(self) -> int:
        """`count`."""
        return self.count


@dataclass(frozen=True)
class Lasting(Fault):
    """A fault that lasts for `duration_s`."""

    duration_s: float = number(1.0, 0.02, FOREVER_S)

    @property
    def fields(self) -> int:
        """The duration in fields."""
        return math.ceil(self.duration_s * 50 - 1e-9)


STEPS = ("restart", "reopen", "reset")
"""What can be done about a grabber, the gentlest first; each does what those before it do."""


@dataclass(frozen=True)
class Mendable(Lasting):
    """A fault that lasts for `duration_s`, or `until` it is mended by a step or a harder one."""

    until: str = choice("time", *STEPS)

    @property
    def fields(self) -> int:
        """The duration in fields; far more than there are where it has to be mended."""
        return super().fields if self.until == "time" else math.ceil(FOREVER_S * 50)

    def is_mended_by(self, step: str) -> bool:
        """Whether this step ends it."""
        return self.until in STEPS[: STEPS.index(step) + 1]


@dataclass(frozen=True)
class Lose(Counted):
    """Fields that never come; the driver's sequence shows the gap."""

    delivers: ClassVar[bool] = False


@dataclass(frozen=True)
class LoseSilently(Counted):
    """Fields that never come, without a gap in the sequence: only time tells."""

    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Repeat(Counted):
    """The picture of the field before comes again, pixel for pixel, as if it were new."""


@dataclass(frozen=True)
class Damage(Counted):
    """The driver flags the field as damaged; half of it is stale."""

    row: int = integer(144, 1, 287)


@dataclass(frozen=True)
class Short(Counted):
    """From `row` on the rows are those of the field before, and nothing says so."""

    row: int = integer(144, 1, 287)


@dataclass(frozen=True)
class Shift(Counted):
    """From `row` on the data are shifted by `shift_px`, round the ends of the lines, and nothing says so."""

    row: int = integer(144, 1, 287)
    shift_px: int = integer(40, -719, 719)


@dataclass(frozen=True)
class Stall(Mendable):
    """Nothing comes, and no error; the driver's sequence does not move."""

    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Fail(Mendable):
    """The stream fails with an error while the device stays there."""

    until: str = choice("restart", "time", "reopen", "reset")
    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Refuse(Lasting):
    """Whoever opens the device is refused: another program has it, or the rights are missing."""

    why: str = choice("busy", "rights")


@dataclass(frozen=True)
class Standard(Lasting):
    """The camera's standard changes: opened anew, 240 rows a field are granted, at 50 Hz as before."""


@dataclass(frozen=True)
class Unplug(Fault):
    """The device goes away; `back_after_s` later it can be opened again."""

    back_after_s: float = number(1.0, 0.02, FOREVER_S)
    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False

    @property
    def fields(self) -> int:
        """The absence in fields."""
        return math.ceil(self.back_after_s * 50 - 1e-9)


@dataclass(frozen=True)
class NoSignal(Lasting):
    """The camera's cable is out: fields of `picture` come at full rate.

    Attributes:
        picture: what the grabber makes up.
        told: `signal()` says so.
    """

    picture: str = choice("blue", "black", "noise", "bars")
    told: bool = flag(True)


KINDS: dict[str, type[Fault]] = {
    "lose": Lose,
    "lose_silently": LoseSilently,
    "repeat": Repeat,
    "damage": Damage,
    "short": Short,
    "shift": Shift,
    "stall": Stall,
    "fail": Fail,
    "refuse": Refuse,
    "standard": Standard,
    "unplug": Unplug,
    "no_signal": NoSignal,
}
"""The script's `kind` → what it means."""

F = TypeVar("F", bound=Fault)


class Script:
    """The faults of a grabber, asked by field number."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self._mended_at: dict[Fault, int] = {}

    def at(self, number: int, kind: type[F]) -> F | None:
        """The fault of this kind that holds for a field."""
        found = (fault for fault in self._faults if isinstance(fault, kind) and self._holds(fault, number))
        return next(found, None)

    def delivers(self, number: int) -> bool:
        """Whether the field reaches the driver's buffers."""
        return all(fault.delivers or not self._holds(fault, number) for fault in self._faults)

    def mend(self, step: str, number: int) -> None:
        """Ends the faults that this step helps against, from a field on."""
        for fault in self._faults:
            if isinstance(fault, Mendable) and fault.is_mended_by(step) and self._holds(fault, number):
                self._mended_at[fault] = number

    def _holds(self, fault: Fault, number: int) -> bool:
        return fault.holds(number) and number < self._end(fault)

    def _end(self, fault: Fault) -> int:
        end = fault.first + fault.fields
        return min(end, self._mended_at.get(fault, end))

    def uncounted(self, number: int) -> int:
        """How many fields before this one the sequence passed over; overlaps count once."""
        return sum(last - first for first, last in self._silent_windows(number))

    def _silent_windows(self, number: int) -> Iterator[tuple[int, int]]:
        windows = ((fault.first, self._end(fault)) for fault in self._faults if not fault.counted)
        silent = sorted((min(first, number), min(end, number)) for first, end in windows)
        reached = 0
        for first, last in silent:
            yield max(first, reached), max(last, first, reached)
            reached = max(reached, last)

    def counts_losses(self) -> bool:
        """Whether the sequence shows every field that is lost."""
        return all(fault.counted for fault in self._faults)
