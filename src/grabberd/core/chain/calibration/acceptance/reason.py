"""A reason of a verdict on a calibration, and how values are graded into levels."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

Level = Literal["failed", "remark"]
FAILED: Level = "failed"
REMARK: Level = "remark"

Value = float | int | str


@dataclass(frozen=True, slots=True)
class Reason:
    """One thing that speaks against a calibration.

    Attributes:
        code: Name of the reason, for programs and translations.
        level: `failed` if the calibration must not be used for it, `remark` if somebody should know.
        message: What was found, with values, as a sentence without a full stop.
        hint: What to do.
        values: The values, for translations.
    """

    code: str
    level: Level
    message: str
    hint: str
    values: Mapping[str, Value] = field(default_factory=dict)


class Limits(NamedTuple):
    """Values above which there is a remark, and above which a calibration fails."""

    remark: float
    failed: float

    @property
    def inverted(self) -> "Limits":
        """The limits of the reciprocal, for values that must not be small."""
        return Limits(1 / self.remark, 1 / self.failed)


class Grade(NamedTuple):
    """The level that a value has reached; None for none."""

    level: Level | None

    def reason(
        self, code: str, message: str, hint: str, values: Mapping[str, Value] | None = None
    ) -> Iterator[Reason]:
        """Yield the reason if the value has reached a level."""
        if self.level is not None:
            yield Reason(code, self.level, message, hint, values or {})


def graded(value: float, limits: Limits) -> Grade:
    """Grade a value; one that is not a number fails."""
    if not value <= limits.failed:
        return Grade(FAILED)
    return Grade(REMARK if value > limits.remark else None)
