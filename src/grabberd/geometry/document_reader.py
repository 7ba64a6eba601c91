"""Reader for external documents: checks every value and collects all problems before refusing anything."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError

_SHOWN = 60


class Reading:
    """A document being read: `problems` accumulate, and an invalid value is replaced by a harmless one."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.problems: list[str] = []

    def refuse(self, key: str, value: object, expected: str) -> None:
        """Add a problem: the key, its value and what was expected."""
        shown = repr(value)
        shown = shown if len(shown) <= _SHOWN else shown[:_SHOWN] + "…"
        self.problems.append(f"{key}: is {shown}, expected {expected}")

    def finish(self, hint: str) -> None:
        """Finish reading.

        Raises:
            InputError: Something was refused; the message lists every problem.
        """
        if self.problems:
            listing = "; ".join(self.problems)
            raise InputError(f"{self.what} cannot be used: {listing}", hint)

    def keys(self, where: str, found: Iterable[object], known: Sequence[str]) -> None:
        """Add a problem for every unknown key."""
        for key in found:
            if key not in known:
                self.problems.append(f"{where}{key}: unknown key; known keys are {', '.join(known)}")

    def mapping(self, holder: Mapping[str, object], key: str, where: str = "") -> Mapping[str, object]:
        """Read the mapping at `key`."""
        value = self._take(holder, key, where, "a mapping")
        if isinstance(value, Mapping):
            return value
        if value is not None:
            self.refuse(where + key, value, "a mapping")
        return {}

    def text(self, holder: Mapping[str, object], key: str, where: str = "") -> str:
        """Read a non-empty text."""
        value = self._take(holder, key, where, "a text")
        if isinstance(value, str) and value:
            return value
        if value is not None:
            self.refuse(where + key, value, "a text")
        return ""

    def integer(
        self, holder: Mapping[str, object], key: str, where: str = "", least: int | None = None
    ) -> int:
        """Read a whole number, not below `least`."""
        value = self._take(holder, key, where, "a whole number")
        expected = "a whole number" if least is None else f"a whole number from {least}"
        if is_integer(value) and (least is None or value >= least):
            return int(value)
        if value is not None:
            self.refuse(where + key, value, expected)
        return least or 0

    def number(
        self, holder: Mapping[str, object], key: str, where: str = "", positive: bool = False
    ) -> float:
        """Read a finite number, above zero if `positive`."""
        expected = "a number above 0" if positive else "a finite number"
        value = self._take(holder, key, where, expected)
        if is_number(value) and (value > 0 or not positive):
            return float(value)
        if value is not None:
            self.refuse(where + key, value, expected)
        return 1.0

    def numbers(self, value: object, key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Read an array of finite numbers of the given shape."""
        expected = f"{' x '.join(map(str, shape))} finite numbers"
        if has_shape(value, shape):
            return np.array(value, np.float64).reshape(shape)
        self.refuse(key, value, expected)
        return np.zeros(shape)

    def _take(self, holder: Mapping[str, object], key: str, where: str, expected: str) -> object:
        if holder.get(key) is None:
            self.problems.append(f"{where}{key}: is missing, expected {expected}")
            return None
        return holder[key]


def is_integer(value: object) -> TypeGuard[int]:
    """True for a whole number (and not a boolean)."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_number(value: object) -> TypeGuard[float]:
    """True for a finite number (and not a boolean)."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def has_shape(value: object, shape: tuple[int, ...]) -> bool:
    """True for nested sequences of finite numbers with this shape."""
    if not shape:
        return is_number(value)
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != shape[0]:
        return False
    return all(has_shape(item, shape[1:]) for item in value)
