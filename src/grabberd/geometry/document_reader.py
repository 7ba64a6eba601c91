"""Reading a document from outside: every value checked, all problems gathered before anything is refused."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError

_SHOWN = 60


class Reading:
    """A document being read; `problems` grows, a value that cannot be used is replaced by a harmless one."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.problems: list[str] = []

    def refuse(self, key: str, value: object, expected: str) -> None:
        """Enters a problem: the key, its value and what it should have been."""
        shown = repr(value)
        shown = shown if len(shown) <= _SHOWN else shown[:_SHOWN] + "…"
        self.problems.append(f"{key}: is {shown}, expected {expected}")

    def finish(self, hint: str) -> None:
        """Ends the reading.

        Raises:
            InputError: something was refused; its message has every problem.
        """
        if self.problems:
            listing = "; ".join(self.problems)
            raise InputError(f"{self.what} cannot be used: {listing}", hint)

    def keys(self, where: str, found: Iterable[object], known: Sequence[str]) -> None:
        """Enters every key that is not known."""
        for key in found:
            if key not in known:
                self.problems.append(f"{where}{key}: unknown key, known are {', '.join(known)}")

    def mapping(self, holder: Mapping[str, object], key: str, where: str = "") -> Mapping[str, object]:
        """A mapping below `key`."""
        value = self._take(holder, key, where, "a mapping")
        if isinstance(value, Mapping):
            return value
        if value is not None:
            self.refuse(where + key, value, "a mapping")
        return {}

    def text(self, holder: Mapping[str, object], key: str, where: str = "") -> str:
        """A text that is not empty."""
        value = self._take(holder, key, where, "a text")
        if isinstance(value, str) and value:
            return value
        if value is not None:
            self.refuse(where + key, value, "a text")
        return ""

    def integer(
        self, holder: Mapping[str, object], key: str, where: str = "", least: int | None = None
    ) -> int:
        """A whole number, not below `least`."""
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
        """A finite number, above zero where that is asked."""
        expected = "a number above 0" if positive else "a finite number"
        value = self._take(holder, key, where, expected)
        if is_number(value) and (value > 0 or not positive):
            return float(value)
        if value is not None:
            self.refuse(where + key, value, expected)
        return 1.0

    def numbers(self, value: object, key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """An array of finite numbers of a given shape."""
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
    """Whether it is a whole number (and no truth value)."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is a finite number (and no truth value)."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def has_shape(value: object, shape: tuple[int, ...]) -> bool:
    """Whether nested sequences of finite numbers have this shape."""
    if not shape:
        return is_number(value)
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != shape[0]:
        return False
    return all(has_shape(item, shape[1:]) for item in value)
