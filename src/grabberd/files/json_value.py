"""JSON texts from files: what they may hold, so that nothing stumbles over it later."""

import json
import math
from typing import Any

LARGEST = 16 << 20
"""Characters of a text; the calibration of a rig has some ten thousand."""
DEEPEST = 40
"""Levels of nesting; a configuration has six."""
LARGEST_INTEGER = 1 << 64
"""No number here is larger; times have 63 bits."""


def read_json(text: str) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: It is no JSON, too large or nested too deeply, or holds numbers or letters that no JSON
            text may hold.
    """
    if not isinstance(text, str):
        raise ValueError(f"a JSON text is {type(text).__name__}")
    if len(text) > LARGEST:
        raise ValueError(f"a JSON text has {len(text)} characters, more than {LARGEST}")
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("a JSON text is nested too deeply") from None
    check_json(value)
    return value


def check_json(value: Any) -> None:
    """Checks a value, level by level: recursion would end where the text's author wants it to.

    Raises:
        ValueError: See `read_json`.
    """
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inner(outer)]
        if not level:
            return
    raise ValueError(f"a JSON text is nested in more than {DEEPEST} levels")


def _inner(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [*value, *value.values()]
    if isinstance(value, list):
        return value
    if isinstance(value, str) and not value.isascii():
        value.encode()  # a lone surrogate, which no answer could hold
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a JSON text holds {value}")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise ValueError("a JSON text holds an integer of more than 64 bits")
    return []
