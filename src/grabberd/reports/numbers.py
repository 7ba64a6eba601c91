"""Numbers as a surveyor writes them: as many digits as they are known to, a real minus, powers of ten."""

import math
from collections.abc import Sequence
from typing import NamedTuple

UNKNOWN = "–"

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class Measured(NamedTuple):
    """A value and its σ as text, at the same place."""

    value: str
    sigma: str


def fixed(value: float | None, places: int) -> str:
    """With so many places after the point."""
    if value is None:
        return UNKNOWN
    written = f"{value:.{places}f}"
    return ("0" + written[2:] if float(written) == 0 and written.startswith("-0") else written).replace(
        "-", "−"
    )


def significant(value: float | None, digits: int = 3) -> str:
    """With so many digits that count; beside a power of ten below 0.0001 and from 100 000 on."""
    if value is None:
        return UNKNOWN
    if value == 0:
        return "0"
    power = _power(value, digits)
    if not -4 <= power < 5:
        return f"{fixed(value / 10.0**power, digits - 1)} × {power_of_ten(power)}"
    return fixed(value, max(digits - 1 - power, 0))


def count(value: int | None) -> str:
    """A whole number."""
    return UNKNOWN if value is None else f"{value:d}".replace("-", "−")


def probability(value: float | None) -> str:
    """A probability, to three places; what is smaller is said to be."""
    if value is None:
        return UNKNOWN
    return "< 0.001" if value < 0.0005 else fixed(value, 3)


def chance(p: float | None) -> str:
    """A probability as an equation that no line breaks: p = 0.123, p < 0.001."""
    written = probability(p)
    return f"p {written if written.startswith('<') else f'= {written}'}".replace(" ", "\u00a0")


def measured(value: float | None, sigma: float | None, exponent: int = 0) -> Measured:
    """σ to two digits and the value to the same place, both divided by ten to the exponent.

    A value without σ (None or 0) is given to six digits.
    """
    if value is None or not sigma:
        return Measured(_plain(value, exponent), UNKNOWN)
    scale = 10.0**exponent
    places = max(1 - _power(sigma / scale, 2), 0)
    return Measured(fixed(value / scale, places), fixed(sigma / scale, places))


def common_exponent(values: Sequence[float | None]) -> int:
    """The power of ten to take out of values that belong together: 0 unless all are below 0.01."""
    largest = max((abs(value) for value in values if value is not None), default=0.0)
    return 0 if largest == 0 or largest >= 1e-2 else _power(largest, 3)


def power_of_ten(exponent: int) -> str:
    """10 with the exponent raised."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def _plain(value: float | None, exponent: int) -> str:
    if value is None:
        return UNKNOWN
    return "0" if value == 0 else f"{value / 10.0**exponent:.6g}".replace("-", "−")


def _power(value: float, digits: int) -> int:
    """The power of ten of the first digit, once the value is rounded."""
    return int(f"{value:.{digits - 1}e}".split("e")[1]) if math.isfinite(value) else 0
