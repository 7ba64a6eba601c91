"""JSON of sensors: the values of the columns, wherever in it they are, and the keys that it has.

A column is named by its key, one that is further down by the keys that lead there: `BMP280.Pressure`, or
`sensors.0.p` in a list. No key is found by its last part alone, as a second sensor would change its meaning.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from grabberd.bounded_documents import DEEPEST
from grabberd.tables import Column, number_of
from grabberd_loggers.lines import ABSENT, IGNORED, OTHER_CELLS, printable

OTHER_UNIT = "a message states another unit than the column"
NOT_JSON, OTHER_KEYS = "a message is not valid JSON", "a message has other keys than the columns"
_SHOWN = 300
_ISO = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:?\d\d)?")
_SEPARATES = re.compile(r"[;,\s]")


class Unusable(ValueError):
    """A message without a reading: `reason` is the same each time, `example` says what this one has."""

    def __init__(self, reason: str, example: str) -> None:
        self.reason, self.example = reason, printable(example)
        super().__init__(reason, self.example)


def cells_of(text: str, columns: Sequence[Column]) -> list[str]:
    """The cells of a line that say the same as a JSON object or list.

    Args:
        text: The message.
        columns: Columns of the line; the values of a list are in their order.

    Raises:
        Unusable: It is not valid JSON, too deep, gives a key twice, has another number of values, or none of
            the measured columns, or one of them only under a longer name.
    """
    try:
        content = json.loads(text, object_pairs_hook=_distinct)
        values = _distinct([*_leaves(content, "", 0)]) if isinstance(content, dict) else content
    except RecursionError:
        raise Unusable(NOT_JSON, _TOO_DEEP) from None
    except ValueError as error:
        raise Unusable(NOT_JSON, f"{error}: {text[:60]}") from None
    if isinstance(values, dict):
        asked = [column for column in columns if column.name != IGNORED]
        _check_keys(values, asked)
        _check_units(values, asked)
        values = [values.get(column.name) for column in columns]
    if len(values) != len(columns):
        raise Unusable(OTHER_CELLS, f"{len(values)} values for {len(columns)} columns: {text[:60]}")
    return [_cell(column, value) for column, value in zip(columns, values, strict=True)]


_TOO_DEEP = f"it is nested in more than {DEEPEST} levels"


def _distinct(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, of which plain JSON silently keeps the last of equal keys."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the key {next(name for name in names if names.count(name) > 1)} is given twice")
    return found


def _leaves(value: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Names and values without parts, in their order."""
    if depth > DEEPEST:
        raise ValueError(_TOO_DEEP)
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if depth and not parts:
        yield name, value
    for key, part in parts:
        yield from _leaves(part, f"{name}.{key}" if depth else str(key), depth + 1)


def _check_keys(values: Mapping[str, Any], columns: Sequence[Column]) -> None:
    missing = [column.name for column in columns if column.name not in values]
    longer = {name: next((key for key in values if key.endswith(f".{name}")), None) for name in missing}
    measured = [column.name for column in columns if not column.is_time]
    if any(longer.values()) or not values.keys() & set(measured):
        keys = ", ".join(values)
        keys = keys if len(keys) <= _SHOWN else f"{keys[:_SHOWN]}…"
        advice = "".join(f"; write {key}" for key in longer.values() if key)
        are = "is" if len(missing) == 1 else "are"
        said = f"the message's keys are {keys}; {', '.join(missing)} {are} not among them{advice}"
        raise Unusable(OTHER_KEYS, said if values else "the message has no keys")


def _check_units(values: Mapping[str, Any], columns: Sequence[Column]) -> None:
    """Check the units that a message states beside its values, as `PressureUnit`, wherever it does."""
    stated = {key.rpartition(".")[2].lower(): text for key, text in values.items() if isinstance(text, str)}
    for column in columns:
        leaf = column.name.rpartition(".")[2].lower()
        unit = next((stated[key] for key in (f"{leaf}unit", f"{leaf}_unit") if key in stated), None)
        if unit and column.unit and _same(unit) != _same(column.unit):
            raise Unusable(
                OTHER_UNIT, f"the message says {column.name} is in {unit}, the column {column.unit}"
            )


def _same(unit: str) -> str:
    unit = unit.strip().lower()
    return {"mbar": "hpa", "torr": "mmhg"}.get(unit, unit)


def _cell(column: Column, value: Any) -> str:
    """A value as a cell; what is not a number stands with its key, in one piece."""
    if value is None or column.name == IGNORED:
        return IGNORED
    if isinstance(value, int | float) and not isinstance(value, bool):
        return str(value)
    if isinstance(value, str):
        words = value.strip().replace(",", ".")
        if column.is_time and column.unit in (None, "s"):
            words = _seconds(value.strip()) or words
        if number_of(words) is not None or words in ABSENT:
            return words or IGNORED
    return _SEPARATES.sub("_", f"{column.name}={value if isinstance(value, str) else json.dumps(value)}")


def _seconds(text: str) -> str | None:
    """Seconds since 1970 of a time in ISO 8601, with its decimals; None for something else.

    Without a zone it is taken for UTC: only the time from one reading to the next counts.
    """
    found = _ISO.fullmatch(text)
    if found is None:
        return None
    day, clock, decimals, zone = found.groups()
    try:
        whole = datetime.fromisoformat(f"{day}T{clock}{zone or ''}")
    except ValueError:
        return None
    seconds = int((whole if whole.tzinfo else whole.replace(tzinfo=UTC)).timestamp())
    return f"{seconds}.{decimals}" if decimals else str(seconds)
