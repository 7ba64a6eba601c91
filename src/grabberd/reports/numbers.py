"""Numbers as a surveyor writes them: as many digits as they are known to, a real minus, powers of ten."""

import math
from collections.abc import Sequence
from typing import NamedTuple

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
