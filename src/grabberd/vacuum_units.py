"""Units of a vacuum, and the magnitudes that a milking machine's has."""

from collections.abc import Callable

LEAST_KPA, MOST_KPA = 15.0, 80.0
"""Limits of the maximum vacuum of a milking machine, below atmosphere."""

PRESSURE_UNITS = {
    "kPa": 1.0,
    "mbar": 0.1,
    "hPa": 0.1,
    "Pa": 0.001,
    "bar": 100.0,
    "mmHg": 0.133322,
    "Torr": 0.133322,
    "inHg": 3.38639,
    "psi": 6.894757,
}
"""Units of pressure, in kPa."""
OTHER_UNITS = {"V": 1.0, "mV": 0.001, "mA": 1.0, "counts": 1.0}
"""Units of what a sensor's output is measured in, in the one that a gain is given for: V, mA, counts."""

_LIKELY: tuple[tuple[Callable[[float], bool], str], ...] = (
    (lambda top: 400.0 <= top <= 1100.0, "mbar (hPa): divide by 10"),
    (lambda top: 9000.0 <= top <= 110000.0, "Pa: divide by 1000"),
    (lambda top: 80.0 < top <= 110.0, "absolute pressure in kPa: vacuum is atmosphere less pressure"),
    (lambda top: 150.0 < top < 400.0, "mmHg (Torr): multiply by 0.13332, or mbar: divide by 10"),
    (lambda top: 8.0 <= top < LEAST_KPA, "inHg: multiply by 3.3864"),
    (lambda top: 0.15 <= top < 0.8, "bar: multiply by 100"),
)


def likely_unit(top: float) -> str:
    """Advice on numbers that reach `top` and should be kPa of a milking machine's vacuum."""
    likely = next((unit for fits, unit in _LIKELY if fits(top)), None)
    if likely is None:
        return "they are in no unit that a milking machine's vacuum has"
    return f"these numbers look like {likely}"
