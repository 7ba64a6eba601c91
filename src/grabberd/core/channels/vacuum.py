"""Readings of a logger as vacuum: in kPa below atmosphere, by each channel's calibration, with σ; units of a
vacuum, and the magnitudes that a milking machine's has.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.channels.logger import Anomaly, LoggerInfo, Quantity, Readings
from grabberd.errors import InputError

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


IMPOSSIBLE = "an impossible vacuum"
_FACTORS = PRESSURE_UNITS | OTHER_UNITS


class Reference(StrEnum):
    """Pressure that a sensor measures against."""

    VACUUM = "vacuum"
    """Below atmosphere, positive."""
    GAUGE = "gauge"
    """Over atmosphere: vacuum is negative."""
    ABSOLUTE = "absolute"
    """Over nothing: vacuum is atmosphere less that."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A measured quantity: which column of a logger has it, and what its numbers mean.

    pressure in kPa = number · unit · gain + offset, then by its reference; a light has its numbers.

    Attributes:
        name: Its name.
        quantity: What it measures.
        column: The logger's column.
        unit: Unit of the numbers; None: the one that the logger states.
        gain: kPa by which the pressure differs for one kPa, V, mA or count of the numbers; None: 1 for
            pressures.
        offset_kpa: Pressure at 0.
        sigma_kpa: Standard deviation of the calibration, which is the same for all readings.
        calibrated: Day of the calibration, ISO 8601, or None if it was never done.
        reference: What the sensor measures against.
        atmosphere_kpa: Atmospheric pressure, for a sensor of absolute pressure.
        devices: Grabbers whose pictures it belongs to; none named: all.
    """

    name: str
    quantity: Quantity
    column: str
    sigma_kpa: float
    unit: str | None = None
    gain: float | None = None
    offset_kpa: float = 0.0
    calibrated: str | None = None
    reference: Reference = Reference.VACUUM
    atmosphere_kpa: float | None = None
    devices: tuple[str, ...] = ()

    def problems(self, info: LoggerInfo) -> list[str]:
        """Reasons why it cannot be measured by this logger."""
        if self.column not in info.channels:
            return [f"{self.name}: the logger has no column {self.column}; it has {', '.join(info.channels)}"]
        return self._unit_problems(info) if self.quantity.is_vacuum else []

    def _unit_problems(self, info: LoggerInfo) -> list[str]:
        """Reasons why its numbers mean no pressure."""
        stated = self.stated_unit(info)
        unit = self.unit or stated
        if unit is None:
            return [f"{self.name}: the logger does not state the unit of {self.column}, so 'unit' must"]
        if self.unit is not None and stated is not None and _differ(self.unit, stated):
            return [
                f"{self.name}: the logger states {stated} for {self.column}, the configuration {self.unit}"
            ]
        if unit not in _FACTORS:
            return [f"{self.name}: the unit {unit} is none of {', '.join(_FACTORS)}"]
        if unit in OTHER_UNITS and self.gain is None:
            return [f"{self.name}: numbers in {unit} need a gain, in kPa for each {_base(unit)}"]
        return []

    def stated_unit(self, info: LoggerInfo) -> str | None:
        """The unit that the logger itself states."""
        return info.units[info.channels.index(self.column)]

    def kpa(self, values: Array, unit: str) -> Array:
        """Vacuum in kPa below atmosphere; of a light, the numbers themselves."""
        if not self.quantity.is_vacuum:
            return values
        pressure = values * (_FACTORS[unit] * (1.0 if self.gain is None else self.gain)) + self.offset_kpa
        if self.reference is Reference.ABSOLUTE:
            assert self.atmosphere_kpa is not None
            return self.atmosphere_kpa - pressure
        return -pressure if self.reference is Reference.GAUGE else pressure


class Vacuum(NamedTuple):
    """K readings of a logger's channels.

    Attributes:
        time_ns: (K,) when each was taken, CLOCK_MONOTONIC, ascending.
        kpa: (K, Q) vacuum below atmosphere, or the level of a light; NaN where there is none.
        time_sigma_ns: Standard deviation of the times, without what is the same for all readings.
        anomalies: The logger's, and readings that are impossible.
    """

    time_ns: NDArray[np.int64]
    kpa: Array
    time_sigma_ns: int
    anomalies: tuple[Anomaly, ...]


class VacuumChannels:
    """The channels of one open logger.

    Args:
        channels: Channels as configured.
        info: The logger as found.
        delay_ns: Time by which all its readings are late: its filter and the shortest way.

    Raises:
        InputError: A channel cannot be measured by this logger; it names all that cannot.
    """

    def __init__(self, channels: Sequence[Channel], info: LoggerInfo, delay_ns: int = 0) -> None:
        problems = [problem for channel in channels for problem in channel.problems(info)]
        if problems:
            hint = "correct the channels in the configuration; 'grabberd logger NAME' shows what it says"
            raise InputError("; ".join(problems), hint)
        self.channels = tuple(channels)
        self._columns = [info.channels.index(channel.column) for channel in channels]
        self._units = [channel.unit or channel.stated_unit(info) or "" for channel in channels]
        self._delay_ns = delay_ns

    @property
    def sigma_kpa(self) -> tuple[float, ...]:
        """Standard deviation of each channel's calibration."""
        return tuple(channel.sigma_kpa for channel in self.channels)

    def vacuum(self, readings: Readings) -> Vacuum:
        """Readings as vacuum; what no milking machine can have is left out and named."""
        kpa = np.empty((len(readings.time_ns), len(self.channels)))
        anomalies = list(readings.anomalies)
        for place, (channel, column, unit) in enumerate(
            zip(self.channels, self._columns, self._units, strict=True)
        ):
            kpa[:, place] = channel.kpa(readings.values[:, column], unit)
            if channel.quantity.is_vacuum:
                anomalies += _without_impossible(channel.name, kpa[:, place], readings.time_ns)
        time_ns = readings.time_ns - self._delay_ns
        return Vacuum(time_ns, kpa, readings.time_sigma_ns, tuple(anomalies))


def _without_impossible(name: str, kpa: Array, time_ns: NDArray[np.int64]) -> list[Anomaly]:
    """Turns impossible readings of a channel into NaN."""
    with np.errstate(invalid="ignore"):
        wrong = (kpa < -LEAST_KPA) | (kpa > MOST_KPA)
    if not wrong.any():
        return []
    worst = float(kpa[wrong][np.argmax(np.abs(kpa[wrong]))])
    advice = likely_unit(worst) if worst > 0 else "pressure over atmosphere, not vacuum: is it gauge?"
    kpa[wrong] = np.nan
    when_ns = int(time_ns[np.flatnonzero(wrong)[-1]])
    return [Anomaly(when_ns, IMPOSSIBLE, f"{name} {worst:.4g} kPa: {advice}", int(wrong.sum()))]


def _differ(one: str, other: str) -> bool:
    if one in _FACTORS and other in _FACTORS:
        return _FACTORS[one] != _FACTORS[other] or (one in OTHER_UNITS) != (other in OTHER_UNITS)
    return one != other


def _base(unit: str) -> str:
    return {"mV": "V", "counts": "count"}.get(unit, unit)
