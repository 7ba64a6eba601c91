"""Scripted faults of a grabber.

A fault holds for a window of camera fields, counted from the first field after the first `open`, or after the
script's cue; the script runs once, however often the grabber is opened again. A new kind is a dataclass and a
line in `KINDS`.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

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
        """Number of fields for which the fault lasts."""
        raise NotImplementedError

    def holds(self, number: int) -> bool:
        """True if the fault applies to this field."""
        return self.first <= number < self.first + self.fields

    def check(self) -> Iterator[str]:
        """Problems of this fault's options."""
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
class Recoverable(Lasting):
    """A fault that lasts for `duration_s`, or `until` it is cleared by a step or a harder one."""

    until: str = choice("time", *STEPS)

    @property
    def fields(self) -> int:
        """The duration in fields; far more than there are where it has to be cleared."""
        return super().fields if self.until == "time" else math.ceil(FOREVER_S * 50)

    def is_cleared_by(self, step: str) -> bool:
        """True if this recovery step ends the fault."""
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
class Timestamp(Lasting):
    """The driver's times are wrong: zero, running backward, or an hour ahead on another clock."""

    says: str = choice("zero", "backward", "another_clock")

    def time_ns(self, number: int, true_ns: int) -> int:
        """Time stamp that the driver reports for field `number`, exposed at `true_ns`."""
        if self.says == "zero":
            return 0
        if self.says == "backward":
            return true_ns - 2 * (number - self.first + 1) * PERIOD_NS
        return true_ns + 3_600_000_000_000


@dataclass(frozen=True)
class Wrap(Counted):
    """The driver's sequence passes 2³² so many fields after each `open` or `restart`."""


@dataclass(frozen=True)
class Storm(Lasting):
    """Whoever asks for a field is sent away at once, with nothing and no error; fields wait meanwhile."""


@dataclass(frozen=True)
class DeadInput(Lasting):
    """The camera's cable is out, `signal()` says so, and nothing comes."""

    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Stall(Recoverable):
    """Nothing comes, and no error; the driver's sequence does not move."""

    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Fail(Recoverable):
    """The stream fails with an error while the device stays there."""

    until: str = choice("restart", "time", "reopen", "reset")
    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


@dataclass(frozen=True)
class Refuse(Lasting):
    """Whoever opens the device is refused: another program has it, or rights or bandwidth are missing."""

    why: str = choice("busy", "rights", "bandwidth")


@dataclass(frozen=True)
class Standard(Lasting):
    """The camera's standard changes: opened anew, 240 rows a field are granted, at 50 Hz as before."""


@dataclass(frozen=True)
class Unplug(Fault):
    """The device goes away; `back_after_s` later it can be opened again, `elsewhere`: as another node."""

    back_after_s: float = number(1.0, 0.02, FOREVER_S)
    elsewhere: bool = flag(False)
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
    "timestamp": Timestamp,
    "wrap": Wrap,
    "storm": Storm,
    "dead_input": DeadInput,
    "stall": Stall,
    "fail": Fail,
    "refuse": Refuse,
    "standard": Standard,
    "unplug": Unplug,
    "no_signal": NoSignal,
}
"""The script's `kind` → what it means."""
