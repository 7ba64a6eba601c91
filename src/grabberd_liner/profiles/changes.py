"""Differences of two versions of a profile in words, key by key."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_LONGEST = 60


def changes_in_words(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Differences key by key, such as `material.E_mpa: 3.0 → 3.2`."""
    old, new = dict(_values(before, "")), dict(_values(after, ""))
    return [
        f"{key}: {_shown(old, key)} → {_shown(new, key)}"
        for key in dict.fromkeys([*old, *new])
        if (key in old) != (key in new) or old[key] != new[key]
    ]


def _values(value: object, key: str) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _values(one, f"{key}.{name}" if key else str(name))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for at, one in enumerate(value):
            yield from _values(one, f"{key}[{at}]")
    else:
        yield key, value


def _shown(values: Mapping[str, object], key: str) -> str:
    if key not in values:
        return "–"
    shown = str(values[key])
    return shown if len(shown) <= _LONGEST else shown[:_LONGEST] + "…"
