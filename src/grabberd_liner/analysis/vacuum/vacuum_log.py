"""Readings of a vacuum logger, on the logger's clock."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.channels.vacuum import LEAST_KPA, MOST_KPA, PRESSURE_UNITS, likely_unit
from grabberd.errors import InputError
from grabberd.tables import TIME_UNITS_NS, Column, Table, TableError

MOMENTS = ("timestamp", "date_time", "datetime")
"""Names of columns of dates with times of day, beside `time` without a unit."""
PULSATION, LINER, LIGHT = "pulsation_vacuum_kpa", "liner_vacuum_kpa", "light"
_TIME, _PULSATION, _LINER = "time", "pulsation_vacuum", "liner_vacuum"
_NEEDED = {_TIME: "time_s or time_ms", _PULSATION: PULSATION}
_UNITS: Mapping[str, Mapping[str, float]] = {
    _TIME: {unit: ns / 1e9 for unit, ns in TIME_UNITS_NS.items()},
    _PULSATION: PRESSURE_UNITS,
    _LINER: PRESSURE_UNITS,
}

_GAP_STEPS = 3.0
"""Steps between two readings from which on readings are missing; a logger's clock may jitter by less."""
_LEAST_ROWS = 10
_SHORTEST_STEP_S = 20e-6
"""Step of the fastest loggers; milliseconds with points for thousands, 1.000 and 1.005, give 5 us."""
_COLUMNS = (
    f"the header names the columns: time_s or time_ms, {PULSATION} and, where they are known, {LINER}"
    f" and {LIGHT}; every line below it is one reading"
)


@dataclass(frozen=True, slots=True, eq=False)
class VacuumLog:
    """K readings.

    Attributes:
        time_s: (K,) the logger's own time, ascending.
        pulsation_kpa: (K,) vacuum in the pulsation chamber, below atmosphere.
        liner_kpa: (K,) vacuum in the liner, or None if it was not logged.
        light: (K,) input to which the light in the picture is wired, in any unit, or None likewise.
        channel: name of the capture's own channel that the readings are of, in `pulsation_kpa` whatever it
            measures; None for a log.
    """

    time_s: Array
    pulsation_kpa: Array
    liner_kpa: Array | None = None
    light: Array | None = None
    channel: str | None = None

    def __post_init__(self) -> None:
        """Checks times and units.

        Raises:
            InputError: there are too few readings, times do not ascend, or anything is in another unit.
        """
        if len(self.time_s) < _LEAST_ROWS:
            hint = _COLUMNS if self.channel is None else "the capture's channels say what is missing, and why"
            raise InputError(f"{self.source} has {len(self.time_s)} readings", hint)
        back = np.flatnonzero(np.diff(self.time_s) <= 0)
        if len(back):
            raise InputError(
                f"the times of {self.source} do not ascend: reading {back[0] + 2} is at"
                f" {self.time_s[back[0] + 1]:g} s, the one before at {self.time_s[back[0]]:g} s",
                "sort the log by time, and cut it where the logger was restarted",
            )
        if self.channel is None and self.step_s < _SHORTEST_STEP_S:
            raise InputError(
                f"the readings of {self.source} are {self.step_s * 1e6:.3g} us apart: its times are in "
                "another unit, or have points for thousands",
                "name the unit of its times, time_s or time_ms, and write no signs for thousands",
            )
        if self.channel is None:
            _check_unit(f"{PULSATION} of {self.source}", self.pulsation_kpa, LEAST_KPA)
        else:
            # Its unit is configured, and a liner at atmosphere has no vacuum for as long as it is captured.
            _check_unit(self.source, self.pulsation_kpa, -LEAST_KPA)
        if self.liner_kpa is not None:
            _check_unit(f"{LINER} of {self.source}", self.liner_kpa, LEAST_KPA)

    @property
    def source(self) -> str:
        """Name of the readings, for people."""
        return "the vacuum log" if self.channel is None else f"the recorded channel {self.channel}"

    @property
    def step_s(self) -> float:
        """Median time between readings."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def gaps_s(self) -> list[tuple[float, float]]:
        """Gaps in the readings: start and end, in the logger's time."""
        after = np.flatnonzero(np.diff(self.time_s) > _GAP_STEPS * self.step_s)
        return [(float(self.time_s[k]), float(self.time_s[k + 1])) for k in after]


def reading_noise(values: Array) -> float:
    """σ of one of (K,) readings, from its departure from the mean of its neighbours."""
    # The median ignores slopes' corners; 1.4826 turns it into σ, and √1.5 is the σ of such a departure.
    bend = values[1:-1] - (values[:-2] + values[2:]) / 2
    return float(1.4826 * np.median(np.abs(bend)) / math.sqrt(1.5))


def read_vacuum_log(text: str) -> VacuumLog:
    """A log from the text of a table; its times begin at 0 where they are dates with times of day.

    Raises:
        InputError: columns or numbers are missing, times do not ascend, or the magnitudes are not
            those of kPa of vacuum.
    """
    try:
        return _log(text)
    except TableError as error:
        raise InputError(f"the vacuum log cannot be read: {error}", error.hint) from error


def _log(text: str) -> VacuumLog:
    table = Table(text, [(_TIME, *MOMENTS), (_PULSATION,)], (_LINER, LIGHT), may_count=True)
    found = {name: table.place(name) for name in (_TIME, _PULSATION, _LINER, LIGHT)}
    if found[_TIME] is None:
        found[_TIME] = table.place(*MOMENTS)
    if missing := [words for name, words in _NEEDED.items() if found[name] is None]:
        raise InputError(f"the vacuum log {table.missing(*missing)}", _COLUMNS)
    places = {name: place for name, place in found.items() if place is not None}
    scales = {name: _scale(table.columns[place], _UNITS.get(name)) for name, place in places.items()}
    cells = table.cells(places)
    numbers = cells.numbers([name for name, scale in scales.items() if scale is not None])
    columns = {name: np.array(values) * scales[name] for name, values in numbers.items()}
    if _TIME not in columns:
        columns[_TIME] = _seconds(cells.columns[_TIME], cells.lines, cells.names[_TIME])
    return VacuumLog(columns[_TIME], columns[_PULSATION], columns.get(_LINER), columns.get(LIGHT))


def _scale(column: Column, units: Mapping[str, float] | None) -> float | None:
    """Factor to s or kPa, and 1 for what may have any unit; None for a time without a unit: moments.

    Raises:
        TableError: The unit is not stated, or it is none of these.
    """
    if units is None:
        return 1.0
    if column.unit is None and column.quantity in (_TIME, *MOMENTS):
        return None
    if column.unit is None or column.unit not in units:
        unit = "is not stated" if column.unit is None else f"is {column.unit}"
        hint = f"state one of {', '.join(units)}: '{column.name} [{next(iter(units))}]'"
        raise TableError(f"the unit of its column {column.name} {unit}", hint)
    return units[column.unit]


def _seconds(moments: Sequence[str], lines: Sequence[int], name: str) -> Array:
    """(K,) seconds since the first of K dates with times of day, as ISO 8601 writes them."""
    seconds = np.empty(len(moments))
    wrong = "not a date with a time of day as in ISO 8601"
    for row, (moment, line) in enumerate(zip(moments, lines, strict=True)):
        try:
            now, first = _moment(moment), _moment(moments[0])
            if (now.tzinfo is None) != (first.tzinfo is None):
                wrong = f"and only one of it and the first, {moments[0]!r}, states its time zone"
            seconds[row] = (now - first).total_seconds()
        except (ValueError, TypeError):
            hint = "write 2026-03-01T10:00:00.010, or seconds in a column time_s, or milliseconds in time_ms"
            raise TableError(f"line {line}: {name} is {moment!r}, {wrong}", hint) from None
    return seconds


def _moment(text: str) -> datetime:
    moment = datetime.fromisoformat(text)
    if ":" not in text:
        raise ValueError(f"{text} has no time of day")
    return moment


def _check_unit(name: str, kpa: Array, least_kpa: float) -> None:
    """A milking machine's vacuum reaches 30 to 60 kPa; other magnitudes are other units."""
    top = float(np.percentile(kpa, 99))
    if float(np.percentile(kpa, 1)) < -LEAST_KPA:
        raise InputError(
            f"{name} goes down to {kpa.min():g}: pressure over atmosphere, not vacuum",
            "turn its sign: vacuum counts downward from atmosphere",
        )
    if not least_kpa <= top <= MOST_KPA:
        raise InputError(
            f"{name} reaches {top:g}, a milking machine's vacuum 30 to 60 kPa",
            likely_unit(top),
        )
