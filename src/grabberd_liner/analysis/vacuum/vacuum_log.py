"""Readings of a vacuum logger, on the logger's clock."""

import csv
import math
from dataclasses import dataclass

import numpy as np

from grabberd.bounded_documents import check_cells
from grabberd.core.channels.vacuum import LEAST_KPA, MOST_KPA, likely_unit
from grabberd.errors import InputError
from grabberd_liner.arrays import Array

TIMES = {"time_s": 1.0, "time_ms": 1e-3}
PULSATION, LINER, LIGHT = "pulsation_vacuum_kpa", "liner_vacuum_kpa", "light"
MOST_READINGS = 1_000_000
"""Readings of a log: a thousand a second for a quarter of an hour."""

_GAP_STEPS = 3.0
"""Steps between two readings from which on readings are missing; a logger's clock may jitter by less."""
_LEAST_ROWS = 10
_COLUMNS = (
    f"the first line names the columns: {' or '.join(TIMES)}, {PULSATION} and, where they are known, {LINER}"
    f" and {LIGHT};"
    " every further line is one reading"
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
            InputError: there are too few readings, times do not ascend, or the values are in another unit.
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

    def noise_kpa(self, kpa: Array) -> float:
        """σ of one reading, from its departure from the mean of its neighbours."""
        # The median ignores slopes' corners; 1.4826 turns it into σ, and √1.5 is the σ of such a departure.
        bend = kpa[1:-1] - (kpa[:-2] + kpa[2:]) / 2
        return float(1.4826 * np.median(np.abs(bend)) / math.sqrt(1.5))


def read_vacuum_log(text: str) -> VacuumLog:
    """A log from CSV text (comma or semicolon, with decimal comma).

    Raises:
        InputError: columns or numbers are missing, times do not ascend, or the magnitudes are not
            those of kPa of vacuum.
    """
    head, *lines = [line for line in text.lstrip("\ufeff").splitlines() if line.strip()] or [""]
    separator = ";" if ";" in head else ","
    names = [name.strip() for name in head.split(separator)]
    time = next((name for name in TIMES if name in names), None)
    if time is None or PULSATION not in names:
        raise InputError(f"the vacuum log has the columns {', '.join(names) or 'none'}", _COLUMNS)
    wanted = {name: names.index(name) for name in (time, PULSATION, LINER, LIGHT) if name in names}
    rows = _rows(lines, separator, len(names), tuple(wanted.values()))
    if separator == ";":
        _check_decimal_mark(rows)
    columns = {name: _numbers(rows, place, name, separator) for place, name in enumerate(wanted)}
    return VacuumLog(columns[time] * TIMES[time], columns[PULSATION], columns.get(LINER), columns.get(LIGHT))


def _rows(lines: list[str], separator: str, count: int, places: tuple[int, ...]) -> list[tuple[str, ...]]:
    """The wanted cells of each line; all others are dropped at once."""
    reader = csv.reader(lines, delimiter=separator)
    rows: list[tuple[str, ...]] = []
    try:
        for row in reader:
            whole = check_cells(reader.line_num + 1, row, count)
            rows.append(tuple(whole[place] for place in places))
            if len(rows) > MOST_READINGS:
                hint = "cut it to the time of the capture"
                raise InputError(f"the vacuum log has more than {MOST_READINGS} readings", hint)
    except csv.Error as error:
        what = f"line {reader.line_num + 1} of the vacuum log is not CSV: {error}"
        raise InputError(what, "correct or remove the line") from error
    except ValueError as error:
        hint = "correct or remove the line; numbers with decimal commas need semicolons between them"
        raise InputError(f"the vacuum log cannot be read: {error}", hint) from error
    return rows


def _check_decimal_mark(rows: list[tuple[str, ...]]) -> None:
    """Refuses commas beside points: a comma may be a decimal mark, or 1,000 a thousand."""
    with_comma, with_point = (
        next((cell for row in rows for cell in row if mark in cell), None) for mark in (",", ".")
    )
    if with_comma and with_point:
        raise InputError(
            f"the vacuum log has both {with_comma.strip()!r} and {with_point.strip()!r}",
            "write all numbers with the same decimal mark, and none for thousands",
        )


def _numbers(rows: list[tuple[str, ...]], place: int, name: str, separator: str) -> Array:
    try:
        values = np.array([row[place] for row in rows], np.float64)
    except ValueError:  # a decimal comma, or a line to be named
        values = np.array([math.nan])
    if np.isfinite(values).all():
        return values
    return np.array([_number(row, place, name, index + 2, separator) for index, row in enumerate(rows)])


def _number(row: tuple[str, ...], place: int, name: str, line: int, separator: str) -> float:
    text = row[place].strip()
    try:
        value = float(text.replace(",", ".") if separator == ";" else text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"line {line} of the vacuum log: {name} is {text!r}, not a number",
            "correct or remove the line; missing readings are never filled in",
        )
    return value


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
