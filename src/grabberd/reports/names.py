"""Keys and names of the document as written for people: symbols, units, colours."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.numbers import DASH

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
"""Symbols of the functional model's parameters."""

COLOURS: Mapping[str, str] = {"left": "#0072b2", "right": "#b34700"}
"""Colours of the views: Okabe and Ito's blue and a darkened vermilion of theirs, which colour-blind readers
tell apart, and which differ in grey as well."""

_UTC = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)(?:\.\d+)?(?:Z|\+00:00)$")
_OTHER_VIEWS = ("#007a5a", "#8a4f7d", "#7a6a00", "#444444")
_WORDS = {"frame": "calibration frame's targets", "alpha": "significance level α"}
_UNITS = {"mm": "mm", "px": "px", "deg": "°", "rad": "rad", "C": "°C", "s": "s", "ms": "ms", "utc": "UTC"}


def colour(view: str, views: Sequence[str] = ()) -> str:
    """Return the colour of a view, the same in every figure and table."""
    if view in COLOURS:
        return COLOURS[view]
    return _OTHER_VIEWS[(list(views).index(view) if view in views else 0) % len(_OTHER_VIEWS)]


def symbol(parameter: str) -> str:
    """Return a parameter's symbol: tied parameters with an equals sign, an unfamiliar name as it is."""
    return " = ".join(SYMBOLS.get(part, part) for part in parameter.split("="))


def unknown_name(name: str) -> str:
    """Write the name of an unknown of the adjustment: "left.b8=b9" as "left b₈ = b₉"."""
    view, point, parameter = name.partition(".")
    return f"{view} {symbol(parameter)}" if point else symbol(name)


def label(key: str) -> str:
    """Write a key of the document in words, its unit in brackets: "target diameter [mm]"."""
    words = _WORDS.get(key, key).split("_")
    unit = _UNITS.get(words[-1]) if len(words) > 1 else None
    return f"{' '.join(words[:-1])} [{unit}]" if unit else " ".join(words)


def utc_time(utc: str) -> str:
    """Write an ISO 8601 time in UTC without its T and its fractions; any other text as it is."""
    return _UTC.sub(r"\1 \2 UTC", utc)


def as_text(value: Any) -> str:
    """Write any value of the document on one line: lists with commas, mappings with their keys in words."""
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return SYMBOLS.get(value) or utc_time(value)
    if isinstance(value, Mapping):
        return "; ".join(f"{label(str(key))} {as_text(inner)}" for key, inner in value.items()) or "none"
    if isinstance(value, Sequence):
        return ", ".join(map(as_text, value)) or "none"
    return f"{value:.6g}".replace("-", "−")
