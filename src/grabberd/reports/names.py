"""How the document's keys and names are written for people: symbols, units, colours."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.numbers import UNKNOWN

SYMBOLS: Mapping[str, str] = {
    "f_mm": "f",
    "x0_px": "x₀",
    "y0_px": "y₀",
    "omega_rad": "ω",
    "phi_rad": "φ",
    "kappa_rad": "κ",
    "X0_mm": "X₀",
    "Y0_mm": "Y₀",
    "Z0_mm": "Z₀",
    **{f"b{index}": f"b{chr(0x2080 + index)}" for index in range(1, 10)},
}
"""The functional model's parameters."""

COLOURS: Mapping[str, str] = {"left": "#0072b2", "right": "#b34700"}
"""Of the views: the blue and a darkened vermilion of Okabe and Ito, told apart by every eye and in grey."""

_INSTANT = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)(?:\.\d+)?(?:Z|\+00:00)$")
_OTHER_VIEWS = ("#007a5a", "#8a4f7d", "#7a6a00", "#444444")
_WORDS = {"frame": "calibration frame's targets", "alpha": "level of the tests α"}
_UNITS = {"mm": "mm", "px": "px", "deg": "°", "rad": "rad", "C": "°C", "s": "s", "ms": "ms", "utc": "UTC"}


def colour(view: str, views: Sequence[str] = ()) -> str:
    """The colour of a view, the same in every figure and table."""
    if view in COLOURS:
        return COLOURS[view]
    return _OTHER_VIEWS[(list(views).index(view) if view in views else 0) % len(_OTHER_VIEWS)]


def symbol(parameter: str) -> str:
    """A parameter's symbol; two tied ones with their equals sign; an unknown name as it is."""
    return " = ".join(SYMBOLS.get(part, part) for part in parameter.split("="))


def unknown(name: str) -> str:
    """An unknown of the adjustment, "left.b8=b9", as people read it: "left b₈ = b₉"."""
    view, point, parameter = name.partition(".")
    return f"{view} {symbol(parameter)}" if point else symbol(name)


def label(key: str) -> str:
    """A key of the document in words, its unit in brackets: "target diameter [mm]"."""
    words = _WORDS.get(key, key).split("_")
    unit = _UNITS.get(words[-1]) if len(words) > 1 else None
    return f"{' '.join(words[:-1])} [{unit}]" if unit else " ".join(words)


def instant(utc: str) -> str:
    """A time in ISO 8601 as people write it; any other text as it is."""
    return _INSTANT.sub(r"\1 \2 UTC", utc)


def spelled(value: Any) -> str:
    """Any value of the document in a line: lists with commas, mappings with their keys in words."""
    if value is None:
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return SYMBOLS.get(value) or instant(value)
    if isinstance(value, Mapping):
        return "; ".join(f"{label(str(key))} {spelled(inner)}" for key, inner in value.items()) or "none"
    if isinstance(value, Sequence):
        return ", ".join(map(spelled, value)) or "none"
    return f"{value:.6g}".replace("-", "−")
