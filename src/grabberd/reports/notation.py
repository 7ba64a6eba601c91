"""Notation of reports: numbers as a surveyor writes them, symbols and units of keys, colours of the views.

Numbers have as many digits as they are known to, a real minus, and powers of ten.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

DASH = "–"
"""Stands for a value that is not known."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Measured(NamedTuple):
    """A value and its σ as text, rounded at the same decimal place."""

    value: str
    sigma: str


def fixed(value: float | None, decimals: int) -> str:
    """Write a number with a fixed number of decimals."""
    if value is None:
        return DASH
    written = f"{value:.{decimals}f}"
    # A value that rounds to zero has no sign: "−0.00" would claim a direction that the digits do not show.
    unsigned = written[1:] if written.startswith("-") and float(written) == 0 else written
    return unsigned.replace("-", "−")


def significant(value: float | None, digits: int = 3) -> str:
    """Write a number with significant digits; with a power of ten below 0.0001 and from 100 000 on."""
    if value is None:
        return DASH
    if value == 0:
        return "0"
    power = _power(value, digits)
    if not -4 <= power < 5:
        return f"{fixed(value / 10.0**power, digits - 1)} × {power_of_ten(power)}"
    return fixed(value, max(digits - 1 - power, 0))


def count(value: float | None, *, signed: bool = False) -> str:
    """Write a whole number; with its sign if it is one of a direction."""
    if value is None:
        return DASH
    return f"{round(value):{'+' if signed else ''}d}".replace("-", "−")


def probability(value: float | None) -> str:
    """Write a probability to three decimals, smaller ones as "< 0.001"."""
    if value is None:
        return DASH
    return "< 0.001" if value < 0.0005 else fixed(value, 3)


def p_value(p: float | None) -> str:
    """Write a probability as an equation that no line breaks: p = 0.123, p < 0.001."""
    written = probability(p)
    return f"p {written if written.startswith('<') else f'= {written}'}".replace(" ", "\u00a0")


def measured(value: float | None, sigma: float | None, exponent: int = 0) -> Measured:
    """Write σ to two digits and the value to the same place, both divided by ten to the exponent.

    A value without σ (None or 0) is given to six digits.
    """
    if value is None or not sigma:
        return Measured(_plain(value, exponent), DASH)
    scale = 10.0**exponent
    decimals = max(1 - _power(sigma / scale, 2), 0)
    return Measured(fixed(value / scale, decimals), fixed(sigma / scale, decimals))


def common_exponent(values: Sequence[float | None]) -> int:
    """Find the power of ten to take out of values that belong together: 0 unless all are below 0.01."""
    largest = max((abs(value) for value in values if value is not None), default=0.0)
    return 0 if largest == 0 or largest >= 1e-2 else _power(largest, 3)


def power_of_ten(exponent: int) -> str:
    """Write 10 with a raised exponent."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def _plain(value: float | None, exponent: int) -> str:
    if value is None:
        return DASH
    return "0" if value == 0 else f"{value / 10.0**exponent:.6g}".replace("-", "−")


def _power(value: float, digits: int) -> int:
    """The power of ten of the first digit once the value is rounded: 0.0996 to two digits starts at 0.1."""
    return int(f"{value:.{digits - 1}e}".split("e")[1]) if math.isfinite(value) else 0


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
