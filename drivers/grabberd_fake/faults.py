"""Scripted faults of a grabber, and the script that looks them up by field number.

A fault applies to a window of camera fields, counted from the first field after the first `open`, or after
the script's cue; the script runs once, however often the grabber is reopened. To add a kind, add a dataclass
and a line in `KINDS`.
"""

import math
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import ClassVar, Self, TypeVar

from grabberd_fake.reading import choice, flag, integer, number

PERIOD_NS = 20_000_000
"""Time from field to field, unless another rate is asked for."""

FOREVER_S = 1e9


@dataclass(frozen=True)
class Fault:
    """One entry of the script.

    Attributes:
        at_s: start in seconds from the first field.
        at_field: start in fields from the first field; exactly one of the two has to be given.
    """

    at_s: float | None = number(None, 0, FOREVER_S, optional=True)
    at_field: int | None = integer(None, 0, 2**32, optional=True)
    delivers: ClassVar[bool] = True
    """True if its fields reach the driver's buffers."""
    counted: ClassVar[bool] = True
    """True if the driver's sequence counts its fields."""
    rate_hz: ClassVar[float] = 1e9 / PERIOD_NS
    """Fields per second; see `paced`."""

    def paced(self, rate_hz: float) -> Self:
        """The same fault of a camera that gives so many fields a second."""
        if rate_hz == self.rate_hz:
            return self
        one = copy(self)
        object.__setattr__(one, "rate_hz", rate_hz)
        return one

    def _fields_in(self, seconds: float) -> int:
        return math.ceil(seconds * self.rate_hz - 1e-9)

    @property
    def first(self) -> int:
        """Number of the first affected field."""
        # A decimal such as 0.06 s is not exact in binary: without the slack it could start a field too late.
        return self.at_field if self.at_field is not None else self._fields_in(self.at_s or 0.0)

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
    """A fault that lasts for `count` fields."""

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
        return self._fields_in(self.duration_s)


@dataclass(frozen=True)
class Endless(Fault):
    """A fault that nothing ends."""

    @property
    def fields(self) -> int:
        """Practically endless."""
        return self._fields_in(FOREVER_S)


class Unseen:
    """Part of a fault whose fields neither reach the driver's buffers nor count."""

    delivers: ClassVar[bool] = False
    counted: ClassVar[bool] = False


STEPS = ("restart", "reopen", "reset")
"""Recovery steps, the gentlest first; each includes those before it."""


@dataclass(frozen=True)
class Recoverable(Lasting):
    """A fault that lasts for `duration_s`, or `until` a recovery step or a harder one clears it."""

    until: str = choice("time", *STEPS)

    @property
    def fields(self) -> int:
        """The duration in fields; practically endless if a step has to clear it."""
        return super().fields if self.until == "time" else self._fields_in(FOREVER_S)

    def is_cleared_by(self, step: str) -> bool:
        """True if this recovery step ends the fault."""
        return self.until in STEPS[: STEPS.index(step) + 1]


@dataclass(frozen=True)
class Lose(Counted):
    """Fields that never arrive; the driver's sequence shows the gap."""

    delivers: ClassVar[bool] = False


@dataclass(frozen=True)
class LoseSilently(Unseen, Counted):
    """Fields that never arrive, without a gap in the sequence: only timestamps show the loss."""


@dataclass(frozen=True)
class Repeat(Counted):
    """The previous field's picture is delivered again, pixel for pixel, as if it were new."""


@dataclass(frozen=True)
class Damage(Counted):
    """The driver flags the field as damaged; half of it is stale."""

    row: int = integer(144, 1, 287)


@dataclass(frozen=True)
class Short(Counted):
    """From `row` on the rows are those of the previous field, without any flag."""

    row: int = integer(144, 1, 287)


@dataclass(frozen=True)
class Shift(Counted):
    """From `row` on the data are shifted by `shift_px`, wrapping at the ends of lines, without any flag."""

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
            return true_ns - 2 * (number - self.first + 1) * round(1e9 / self.rate_hz)
        return true_ns + 3_600_000_000_000


@dataclass(frozen=True)
class ClockStep(Endless):
    """The clock of the driver's timestamps is set by `by_s`, for good."""

    by_s: float = number(-3600.0, -FOREVER_S, FOREVER_S)


@dataclass(frozen=True)
class Turn(Endless):
    """The camera goes on in the other phase: the parity of every later field is the other one."""


@dataclass(frozen=True)
class Recount(Endless):
    """The driver's sequence goes on from `count`: it restarts or skips."""

    count: int = integer(0, 0, 2**32 - 1)


@dataclass(frozen=True)
class Knock(Endless):
    """The camera, or the mirror of one view that is nearest to the object, is turned for good.

    Attributes:
        what: what is turned.
        x_mrad: turn about the camera's x axis, along the lines; `y_mrad`, `z_mrad`: about its others.
    """

    what: str = choice("camera", "left", "right")
    x_mrad: float = number(0.0, -50, 50)
    y_mrad: float = number(0.0, -50, 50)
    z_mrad: float = number(0.0, -50, 50)


@dataclass(frozen=True)
class Bunch(Lasting):
    """Fields reach the driver's buffers at the end of the fault, all at once: the bus stood still."""


@dataclass(frozen=True)
class Freeze(Lasting):
    """Requests for a field return only when the fault is over: the program did not run."""


@dataclass(frozen=True)
class Busy(Lasting):
    """Requests for a field are late by `mean_ms` on average, exponentially: the program seldom runs."""

    mean_ms: float = number(20.0, 1, 1000)


@dataclass(frozen=True)
class Wrap(Counted):
    """The driver's sequence wraps at 2³², that many fields after each `open` or `restart`."""


@dataclass(frozen=True)
class Storm(Lasting):
    """Requests for a field return at once with nothing and no error, while fields are waiting."""


@dataclass(frozen=True)
class DeadInput(Unseen, Lasting):
    """The camera's cable is out, `signal()` reports it, and no fields arrive."""


@dataclass(frozen=True)
class Stall(Unseen, Recoverable):
    """No fields arrive and no error is raised; the driver's sequence stands still."""


@dataclass(frozen=True)
class Fail(Unseen, Recoverable):
    """The stream fails with an error while the device remains present."""

    until: str = choice("restart", "time", "reopen", "reset")


@dataclass(frozen=True)
class Refuse(Lasting):
    """Opening the device is refused: another program has it, or rights or bandwidth are missing."""

    why: str = choice("busy", "rights", "bandwidth")


@dataclass(frozen=True)
class Standard(Lasting):
    """The camera's standard changes: when reopened, 240 rows a field are granted, at the same rate."""


@dataclass(frozen=True)
class Unplug(Unseen, Fault):
    """The device disappears and returns after `back_after_s`, as another node if `elsewhere`."""

    back_after_s: float = number(1.0, 0.02, FOREVER_S)
    elsewhere: bool = flag(False)

    @property
    def fields(self) -> int:
        """The absence in fields."""
        return self._fields_in(self.back_after_s)


@dataclass(frozen=True)
class NoSignal(Lasting):
    """The camera's cable is out: fields of `picture` come at full rate.

    Attributes:
        picture: picture that the grabber generates.
        told: True if `signal()` reports the loss.
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
    "clock_step": ClockStep,
    "turn": Turn,
    "recount": Recount,
    "knock": Knock,
    "bunch": Bunch,
    "freeze": Freeze,
    "busy": Busy,
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
"""Fault classes by the script's `kind`."""


F = TypeVar("F", bound=Fault)


class Script:
    """The faults of a grabber that gives so many fields a second, looked up by field number."""

    def __init__(self, faults: Sequence[Fault], rate_hz: float = Fault.rate_hz) -> None:
        self._faults = tuple(fault.paced(rate_hz) for fault in faults)
        self._cleared_at: dict[Fault, int] = {}

    def at(self, number: int, kind: type[F]) -> F | None:
        """The fault of this kind that affects a field, or None."""
        found = (fault for fault in self._faults if isinstance(fault, kind) and self._holds(fault, number))
        return next(found, None)

    def before(self, number: int, kind: type[F]) -> list[F]:
        """The faults of this kind that have begun by a field."""
        return [fault for fault in self._faults if isinstance(fault, kind) and fault.first <= number]

    def delivers(self, number: int) -> bool:
        """True if the field reaches the driver's buffers."""
        return all(fault.delivers or not self._holds(fault, number) for fault in self._faults)

    def clear(self, step: str, number: int) -> None:
        """Ends the faults that this recovery step clears, from a field on."""
        for fault in self._faults:
            if isinstance(fault, Recoverable) and fault.is_cleared_by(step) and self._holds(fault, number):
                self._cleared_at[fault] = number

    def _holds(self, fault: Fault, number: int) -> bool:
        return fault.holds(number) and number < self._end(fault)

    def _end(self, fault: Fault) -> int:
        end = fault.first + fault.fields
        return min(end, self._cleared_at.get(fault, end))

    def uncounted(self, number: int) -> int:
        """Number of fields before this one that the sequence skipped; overlaps count once."""
        return sum(last - first for first, last in self._silent_windows(number))

    def _silent_windows(self, number: int) -> Iterator[tuple[int, int]]:
        windows = ((fault.first, self._end(fault)) for fault in self._faults if not fault.counted)
        silent = sorted((min(first, number), min(end, number)) for first, end in windows)
        reached = 0
        for first, last in silent:
            yield max(first, reached), max(last, first, reached)
            reached = max(reached, last)

    def wraps_after(self) -> int:
        """Number of fields of a stream after which its sequence wraps to zero; 0: it starts there."""
        return next((fault.first for fault in self._faults if isinstance(fault, Wrap)), 0)

    def node(self, number: int) -> int:
        """Number of the device's node: how often it has come back as another one."""
        moves = (fault for fault in self._faults if isinstance(fault, Unplug) and fault.elsewhere)
        return sum(fault.first + fault.fields <= number for fault in moves)

    def counts_losses(self) -> bool:
        """True if the sequence shows every lost field."""
        return all(fault.counted for fault in self._faults)
