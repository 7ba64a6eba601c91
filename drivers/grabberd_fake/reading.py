"""Options from a nested mapping: every key, type and range is checked, and all problems are reported at once.

A dataclass's fields declare their allowed values through `number`, `integer`, `choice`, `flag` and `ruled`;
`read` makes an instance of it from the content of a YAML file.
"""

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, field, fields
from typing import Any, TypeVar

T = TypeVar("T")


class Rule:
    """Type of a value: `read` returns the value converted, or appends the reason why not to `problems`."""

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """The value, or None after a problem."""
        raise NotImplementedError


class Number(Rule):
    """A finite number from `low` to `high`; `whole` asks for an integer, `optional` allows null."""

    def __init__(self, low: float, high: float, whole: bool = False, optional: bool = False) -> None:
        self.low, self.high, self.whole, self.optional = low, high, whole, optional

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """The number as int or float."""
        if value is None and self.optional:
            return None
        if not self._allows(value):
            problems.append(f"{key}: {value!r} is not {self}")
            return None
        return int(value) if self.whole else float(value)

    def _allows(self, value: Any) -> bool:
        wanted = int if self.whole else (int, float)
        good = isinstance(value, wanted) and not isinstance(value, bool) and math.isfinite(value)
        return good and self.low <= value <= self.high

    def __str__(self) -> str:
        kind = "a whole number" if self.whole else "a number"
        return f"{kind} from {self.low:g} to {self.high:g}" + (" or null" if self.optional else "")


class Choice(Rule):
    """One of a few values."""

    def __init__(self, allowed: tuple[Any, ...]) -> None:
        self.allowed = allowed

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """The value itself."""
        # True == 1 in Python, but not in a configuration.
        for allowed in self.allowed:
            if isinstance(value, bool) is isinstance(allowed, bool) and value == allowed:
                return allowed
        problems.append(f"{key}: {value!r} is not one of {', '.join(map(str, self.allowed))}")
        return None


class Text(Rule):
    """A text, or null."""

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """The text itself."""
        if value is not None and not isinstance(value, str):
            problems.append(f"{key}: {value!r} is not a text or null")
        return value


class Group(Rule):
    """A mapping that becomes a dataclass of its own."""

    def __init__(self, made_into: type) -> None:
        self.made_into = made_into

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """An instance of the dataclass; one that was made already passes."""
        return (
            value if isinstance(value, self.made_into) else _read(self.made_into, value, f"{key}.", problems)
        )


class ListOf(Rule):
    """A list whose items follow one rule."""

    def __init__(self, item: Rule) -> None:
        self.item = item

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """A tuple of the items."""
        if not isinstance(value, list | tuple):
            problems.append(f"{key}: {value!r} is not a list")
            return None
        return tuple(self.item.read(f"{key}[{i}]", item, problems) for i, item in enumerate(value))


class OneOfKinds(Rule):
    """A mapping whose `kind` selects the dataclass that the rest of it becomes."""

    def __init__(self, kinds: Mapping[str, type]) -> None:
        self.kinds = kinds

    def read(self, key: str, value: Any, problems: list[str]) -> Any:
        """An instance of the dataclass of that kind."""
        if type(value) in self.kinds.values():
            return value
        if not isinstance(value, Mapping) or value.get("kind") not in self.kinds:
            problems.append(f"{key}: {value!r} has no 'kind' out of {', '.join(self.kinds)}")
            return None
        rest = {name: item for name, item in value.items() if name != "kind"}
        return _read(self.kinds[value["kind"]], rest, f"{key}.", problems)


def ruled(rule: Rule, default: Any = MISSING) -> Any:
    """A dataclass field with a rule; without a default it must be given."""
    return field(default=default, metadata=by(rule))


def by(rule: Rule) -> dict[str, Rule]:
    """The metadata of a dataclass field with a rule."""
    return {"rule": rule}


def number(default: float | None, low: float, high: float, optional: bool = False) -> Any:
    """A field that holds a number."""
    return ruled(Number(low, high, optional=optional), default)


def integer(default: int | None, low: int, high: int, optional: bool = False) -> Any:
    """A field that holds a whole number."""
    return ruled(Number(low, high, whole=True, optional=optional), default)


def choice(default: Any, *others: Any) -> Any:
    """A field that holds one of a few values."""
    return ruled(Choice((default, *others)), default)


def flag(default: bool) -> Any:
    """A field that is true or false."""
    return ruled(Choice((True, False)), default)


def read(made_into: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass from a mapping.

    Args:
        made_into: the dataclass; its `check()`, if any, yields problems that involve several keys.
        values: mapping as read from YAML.

    Raises:
        ValueError: a key is unknown, missing, of a wrong type or out of range; one line for each.
    """
    problems: list[str] = []
    made = _read(made_into, values, "", problems)
    if problems or made is None:
        raise ValueError("\n".join(problems))
    return made


def _read(made_into: type[T], values: Any, owner: str, problems: list[str]) -> T | None:
    if not isinstance(values, Mapping):
        problems.append(f"{owner.rstrip('.')}: {values!r} is not a mapping of keys to values")
        return None
    known = {item.name: item for item in fields(made_into)}  # type: ignore[arg-type]
    already = len(problems)
    unknown = [key for key in values if key not in known]
    problems += [f"{owner}{key}: unknown key; known are {', '.join(known)}" for key in unknown]
    missing = [name for name, item in known.items() if name not in values and _needed(item)]
    problems += [f"{owner}{name}: missing" for name in missing]
    given = {
        name: known[name].metadata["rule"].read(f"{owner}{name}", value, problems)
        for name, value in values.items()
        if name in known
    }
    return _made(made_into, given, owner, problems) if len(problems) == already else None


def _needed(item: "Field[Any]") -> bool:
    return item.default is MISSING and item.default_factory is MISSING


def _made(made_into: type[T], given: dict[str, Any], owner: str, problems: list[str]) -> T:
    made = made_into(**given)
    check = getattr(made, "check", None)
    if check is not None:
        problems += [f"{owner}{problem}" for problem in check()]
    return made
