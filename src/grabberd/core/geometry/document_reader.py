"""Reader for external documents: checks every value and collects all problems before refusing anything."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeGuard, TypeVar, cast

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import InputError
from grabberd.tables import LARGEST_NUMBER

_SHOWN = 100
_MOST_TOLD = 20
"""Problems in a message: whoever has more corrects these first."""
_NAMED = 5
_VALUE = re.compile(r": is .*, expected |: .* is given twice$", re.DOTALL)
"""What differs in the same problem of several entries."""
_LARGEST = (1 << 31) - 1
T = TypeVar("T")


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
            InputError: Something was refused; the message lists the problems, the first of very many.
        """
        if self.problems:
            more = len(self.problems) - _MOST_TOLD
            listing = "; ".join([*self.problems[:_MOST_TOLD], *([f"and {more} more"] if more > 0 else [])])
            raise InputError(f"{self.what} cannot be used: {listing}", hint)

    def keys(self, where: str, found: Iterable[object], known: Sequence[str]) -> None:
        """Add a problem for every unknown key."""
        for key in found:
            if key not in known:
                self.problems.append(f"{where}{key}: unknown key; known keys are {', '.join(known)}")

    def mapping(self, holder: Mapping[str, object], key: str, where: str = "") -> Mapping[str, object]:
        """Read the mapping at `key`."""
        nothing: Mapping[str, object] = {}
        return self._read(holder, key, where, "a mapping", lambda value: isinstance(value, Mapping), nothing)

    def text(self, holder: Mapping[str, object], key: str, where: str = "") -> str:
        """Read a non-empty text."""
        return self._read(holder, key, where, "a text", lambda value: isinstance(value, str) and value, "")

    def integer(
        self,
        holder: Mapping[str, object],
        key: str,
        where: str = "",
        least: int = -_LARGEST,
        most: int = _LARGEST,
    ) -> int:
        """Read a whole number from `least` to `most`; by default, one of those that arrays of int32 hold."""
        expected = "a whole number" + (f" from {least}" if least > -_LARGEST else "")
        expected += f" to {most}" if most < _LARGEST else ""
        return self._read(
            holder,
            key,
            where,
            expected,
            lambda value: is_integer(value) and least <= value <= most,
            max(least, 0),
        )

    def number(
        self, holder: Mapping[str, object], key: str, where: str = "", positive: bool = False
    ) -> float:
        """Read a finite number, above zero if `positive`."""
        expected = "a number above 0" if positive else "a finite number"
        lowest = 0.0 if positive else -math.inf
        return float(
            self._read(holder, key, where, expected, lambda value: is_number(value) and value > lowest, 1.0)
        )

    def numbers(self, value: object, key: str, shape: tuple[int, ...]) -> Array:
        """Read an array of finite numbers of the given shape."""
        expected = f"{' x '.join(map(str, shape))} finite numbers"
        if has_shape(value, shape):
            return np.array(value, np.float64).reshape(shape)
        self.refuse(key, value, expected)
        return np.zeros(shape)

    def _read(
        self,
        holder: Mapping[str, object],
        key: str,
        where: str,
        expected: str,
        fits: Callable[[Any], object],
        harmless: T,
    ) -> T:
        value = holder.get(key)
        if value is None:
            self.problems.append(f"{where}{key}: is missing, expected {expected}")
        elif fits(value):
            return cast("T", value)
        else:
            self.refuse(where + key, value, expected)
        return harmless


def told_once(name: str, labels: Sequence[str], problems: Iterable[Sequence[str]]) -> list[str]:
    """Problems of a list's entries, each of them once, with the number of entries that have it and the first.

    Args:
        name: Key of the list.
        labels: How each entry is called; numbers are ids.
        problems: Of each entry, as `Reading` has them, in the same order.
    """
    alike: dict[str, list[tuple[int, str]]] = {}
    for index, found in enumerate(problems):
        for problem in found:
            alike.setdefault(_VALUE.sub("", problem), []).append((index, problem))
    return [
        f"{name}[{places[0][0]}]{places[0][1]}"
        + _others(name, labels, list(dict.fromkeys(index for index, _ in places)))
        for places in alike.values()
    ]


def _others(name: str, labels: Sequence[str], places: Sequence[int]) -> str:
    """Entries that have the same problem; empty if it is one alone."""
    if len(places) < 2:
        return ""
    share = f"all {len(labels)}" if len(places) == len(labels) else f"{len(places)} of {len(labels)}"
    own = list(dict.fromkeys(labels[index] for index in places))
    first = own[:_NAMED] + ["…"] * (len(own) > _NAMED)
    ids = "ids " if first[0].isdecimal() else ""
    return f" (so in {share} {name}: {ids}{', '.join(first)})"


def is_integer(value: object) -> TypeGuard[int]:
    """True for a whole number (and not a boolean)."""
    # A bool is an int in Python, but true in a document is no number.
    return isinstance(value, int) and not isinstance(value, bool)


def is_number(value: object) -> TypeGuard[float]:
    """True for a finite number that can be reckoned with (and not a boolean)."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_NUMBER


def finite(value: float) -> float | None:
    """A number as documents have it: None where it is not finite."""
    return float(value) if math.isfinite(value) else None


def has_shape(value: object, shape: tuple[int, ...]) -> bool:
    """True for nested sequences of finite numbers with this shape."""
    if not shape:
        return is_number(value)
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != shape[0]:
        return False
    return all(has_shape(item, shape[1:]) for item in value)
