"""Differences of two documents, named by the path to the value that differs."""

import math
from collections.abc import Iterator
from typing import Any

SHOWN = 25
LONGEST = 160
"""Differences and characters of a value that a message shows."""


def differences(kept: Any, now: Any, relative: float = 0.0) -> list[str]:
    """What differs, a line each.

    Args:
        kept: The document of the lock.
        now: The same of this program.
        relative: Share of a number by which it may differ.
    """
    return list(_differences(kept, now, relative, ""))


def told(found: list[str]) -> str:
    """The first of some differences, for a message."""
    more = [f"… and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
    return "\n".join([*found[:SHOWN], *more])


def _differences(kept: Any, now: Any, relative: float, path: str) -> Iterator[str]:
    if isinstance(kept, dict) and isinstance(now, dict):
        for key in sorted({*kept, *now}):
            yield from _of_part(kept, now, relative, path, key)
    elif isinstance(kept, list) and isinstance(now, list):
        if len(kept) != len(now):
            yield f"{path or 'all'}: {len(kept)} parts were kept, there are {len(now)}"
        for k, (one, other) in enumerate(zip(kept, now, strict=False)):
            yield from _differences(one, other, relative, f"{path}[{k}]")
    elif not _same(kept, now, relative):
        yield f"{path or 'all'}: {_short(kept)} was kept, now it is {_short(now)}"


def _of_part(
    kept: dict[str, Any], now: dict[str, Any], relative: float, path: str, key: str
) -> Iterator[str]:
    inner = f"{path} › {key}" if path else key
    if key not in now:
        yield f"{inner}: is gone ({_short(kept[key])})"
    elif key not in kept:
        yield f"{inner}: is new ({_short(now[key])})"
    else:
        yield from _differences(kept[key], now[key], relative, inner)


def _same(kept: Any, now: Any, relative: float) -> bool:
    if relative and isinstance(kept, float) and isinstance(now, float | int):
        return math.isclose(kept, now, rel_tol=relative, abs_tol=relative)
    both_nan = kept != kept and now != now  # noqa: PLR0124 - true of NaN alone
    return type(kept) is type(now) and (kept == now or both_nan)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
