"""Lines of text from a logger: put together from bytes, understood by their columns, and dated as readings.

    time_ms,p1 [kPa],p2 [kPa]            # time_s; p1_mbar; p2_mbar
    12005,41.93,0.02                     12,005; 419,3; 0,2

Cells are separated and quoted as in any table (`grabberd.tables`), and decimal commas are read as well. A
header begins with `time` or `#`, after a nameless column of row names if there is one; any other line that
begins with `#` is a comment. An empty cell, `-` and `nan` say that a column has no reading. Times are the
logger's own, or by its rate, or by arrival.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grabberd.core.channels import (
    Anomaly,
    ArrivalDating,
    ClockRelation,
    Dated,
    Dating,
    MissingReadings,
    Readings,
)
from grabberd.core.channels.dating import MISSING
from grabberd.errors import StreamFailed
from grabberd.tables import (
    TIME_UNITS_NS,
    Column,
    TableError,
    cells_of,
    fitted,
    header_cells,
    number_of,
    separator_of,
    with_units,
)

LONGEST = 4096
"""Bytes of the longest line."""
_END = re.compile(rb"[\r\n]+")
_ENDS = re.compile(r"[\r\n]+")


class LineBuffer:
    """Puts pieces together; a line without an end is dropped, so that memory stays small."""

    def __init__(self) -> None:
        self._rest = b""
        self._is_overlong = False

    @property
    def is_amid_a_line(self) -> bool:
        """True if a line has begun and not ended."""
        return bool(self._rest.strip())

    def push_back(self, data: bytes) -> None:
        """Put bytes before what has come since the last complete line."""
        self._rest = data + self._rest

    def feed(self, data: bytes) -> tuple[Sequence[str], int]:
        """The lines that are complete now, without empty ones, and the number of those too long to be one."""
        *whole, self._rest = _END.split(self._rest + data)
        overlong = 0
        if whole and self._is_overlong:
            del whole[0]  # the end of one that was counted
            self._is_overlong = False
        if len(self._rest) > LONGEST:
            overlong += not self._is_overlong
            self._rest, self._is_overlong = b"", True
        overlong += sum(len(line) > LONGEST for line in whole)
        lines = (line.decode("utf-8", "replace").strip() for line in whole if len(line) <= LONGEST)
        return [line for line in lines if line], overlong


MOST_COLUMNS = 64
IGNORED = "-"
"""Column whose numbers are not read."""
NOT_A_NUMBER, OTHER_CELLS, NO_TIME = "not a number", "another number of cells", "no time"

_NAME = re.compile(r"^[^\W\d][\w .%/+-]*$")
ABSENT = frozenset(["", "-", "nan", "NaN", "NAN"])


class Line(NamedTuple):
    """Content of a line.

    Attributes:
        time_ns: The logger's own time, or None if it has none.
        values: Numbers of the channels; NaN where there is none.
    """

    time_ns: int | None
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LineFormat:
    """Columns of a logger's lines.

    Attributes:
        columns: All of them, the logger's time and the ignored ones too.
        separator: What separates cells; None: what a line suggests.
    """

    columns: tuple[Column, ...]
    separator: str | None = None

    @classmethod
    def of_header(cls, text: str) -> "LineFormat | None":
        """The format that a line announces; None if it is no header.

        Raises:
            ValueError: It is one, but cannot be used.
        """
        has_mark = text.lstrip().startswith("#")
        text = text.strip().lstrip("#").strip()
        if not text:
            return None
        separator = separator_of(text)
        try:
            columns = tuple(map(Column.of, header_cells(text, separator)))
        except TableError:
            return None
        first = columns[0]
        if len(columns) > 1 and not first.name:
            first, columns = columns[1], (Column(IGNORED, None), *columns[1:])
        announces = first.is_time or (has_mark and any(column.unit for column in columns))
        while columns and not columns[-1].name:
            columns = columns[:-1]
        return cls(_checked(columns), separator) if announces else None

    @classmethod
    def of_columns(cls, cells: Sequence[str]) -> "LineFormat":
        """The format of bare numbers.

        Raises:
            ValueError: The columns cannot be used.
        """
        return cls(_checked(tuple(Column.of(cell) for cell in cells)))

    @property
    def channels(self) -> tuple[Column, ...]:
        """Columns that are measured."""
        return tuple(column for column in self.columns if not column.is_time and column.name != IGNORED)

    @property
    def time_unit_ns(self) -> float | None:
        """Unit of the logger's own time; None if it sends none."""
        column = next((column for column in self.columns if column.is_time), None)
        return None if column is None else TIME_UNITS_NS[(column.unit or "s").lower()]

    def read(self, text: str) -> Line | str:
        """The numbers of a line, or the reason why it has none."""
        cells = self._cells(text)
        if len(cells) != len(self.columns):
            return OTHER_CELLS
        time_ns, values = None, []
        for column, cell in zip(self.columns, cells, strict=True):
            if column.name == IGNORED:
                continue
            value = math.nan if cell in ABSENT else number_of(cell)
            if value is None:
                return NOT_A_NUMBER
            if not column.is_time:
                values.append(value)
            elif math.isnan(value):
                return NO_TIME
            else:
                time_ns = round(value * (self.time_unit_ns or 1e9))
        return Line(time_ns, tuple(values))

    def time_step_ns(self, text: str) -> float:
        """Step of the logger's own time, by the decimals that a line writes it with."""
        cell = self._cells(text)[next(i for i, column in enumerate(self.columns) if column.is_time)]
        decimals = len(cell.replace(",", ".").partition(".")[2])
        return (self.time_unit_ns or 1e9) * 10.0**-decimals

    def with_units(self, text: str) -> "LineFormat | None":
        """The format with the units of the line below the header; None if it is no line of units.

        Raises:
            ValueError: It states other units than the header.
        """
        columns = with_units(self.columns, self._cells(text), lambda column: column.name != IGNORED)
        return None if columns is None else replace(self, columns=_checked(columns))

    def _cells(self, text: str) -> Sequence[str]:
        """Cells of a line, without a row's name in quotes that has no head, or empty cells at the end."""
        try:
            cells = cells_of(text, self.separator or separator_of(text))
        except TableError:
            return []
        if len(cells) == len(self.columns) + 1 and text.startswith('"'):
            return cells[1:]
        return fitted(cells, len(self.columns))


def _checked(columns: tuple[Column, ...]) -> tuple[Column, ...]:
    names = Counter(column.name for column in columns if column.name != IGNORED)
    twice = [name for name, times in names.items() if times > 1]
    odd = [name for name in names if not _NAME.match(name)]
    times = [column for column in columns if column.is_time]
    problems = [
        (bool(twice), f"column {', '.join(twice)} is given twice"),
        (bool(odd), f"{', '.join(map(repr, odd))} cannot be the name of a column"),
        (len(columns) > MOST_COLUMNS, f"{len(columns)} columns are more than {MOST_COLUMNS}"),
        (len(times) > 1, "more than one column is the time"),
        (len(names) == len(times), "no column is measured"),
        (
            any((column.unit or "s").lower() not in TIME_UNITS_NS for column in times),
            f"the time's unit is none of {', '.join(TIME_UNITS_NS)}",
        ),
    ]
    found = [text for wrong, text in problems if wrong]
    if found:
        raise ValueError("; ".join(found))
    return columns


def head_of(text: str) -> str:
    """The header of a file and the units below it, out of its first lines; else its first complete line.

    A header with a time is preferred to a comment that could be one; what stands before it is passed over.
    """
    lines = [line for line in _ENDS.split(text)[:-1] if line.strip()]
    for is_comment in (False, True):
        for line, below in pairwise([*lines, ""]):
            if line.startswith("#") is is_comment and (head := _head(line, below)):
                return head
    return f"{lines[0]}\n" if lines else ""


def _head(line: str, below: str) -> str:
    try:
        header = LineFormat.of_header(line)
        has_units = header is not None and header.with_units(below) is not None
    except ValueError:
        has_units = True  # whoever takes the lines says why they cannot be used
    else:
        if header is None:
            return ""
    return f"{line}\n{below}\n" if has_units else f"{line}\n"


REPEATED, HEADER_AGAIN = "a line was repeated", "the header came again"
_SHOWN = 60
_COUNTER_BITS = (32, 16)
"""Sizes of the counters that loggers take their time from; they wrap, and the time goes on."""
_WRAPPED_NS = 60e9
"""Longest time after the last reading at which a counter is believed to have wrapped."""


class Refused(NamedTuple):
    """A refusal in place of a line, or of several, with a reading each.

    Attributes:
        reason: A few words that are the same each time.
        example: What it was.
        lines: Number of lines that it stands for.
    """

    reason: str
    example: str
    lines: int = 1


class LineReadings:
    """Turns a logger's lines into readings.

    Args:
        line_format: Format of the lines; None until a header has given it.
        rate_hz: Readings per second, if lines without a time come at a steady rate.
        begins_anywhere: True if the first line may have lost its beginning.
    """

    def __init__(self, line_format: LineFormat | None, rate_hz: float | None, begins_anywhere: bool) -> None:
        self.format = line_format
        self._rate_hz = rate_hz
        self._skips_first = begins_anywhere
        self._relation: ClockRelation | None = None
        self._arrivals, self._missing = ArrivalDating(), MissingReadings()
        self._counted = 0
        self._newest_own_ns: int | None = None
        self._wraps_ns = 0

    @property
    def dating(self) -> Dating:
        """Source of the readings' times."""
        has_time = self.format is not None and self.format.time_unit_ns is not None
        return Dating.OWN_CLOCK if has_time or self._rate_hz else Dating.ARRIVAL

    def take(self, lines: Sequence[str | Refused], arrival_ns: int) -> Readings:
        """Readings and anomalies of lines that arrived together.

        Raises:
            StreamFailed: A header announces other columns or units, or cannot be used.
        """
        anomalies: list[Anomaly] = []
        own_ns: list[int] = []
        values: list[tuple[float, ...]] = []
        for text in lines:
            if isinstance(text, Refused):
                anomalies.append(self._refused(text, arrival_ns))
                continue
            line = self._line(text, arrival_ns, anomalies)
            if line is not None:
                own_ns.append(self._own_ns(line))
                values.append(line.values)
        if not values:
            return Readings.none(len(self.format.channels) if self.format else 0, anomalies)
        dated = self._date(np.array(own_ns, np.int64), arrival_ns)
        rows = np.array(values, np.float64)
        return Readings(dated.time_ns, rows, (*anomalies, *dated.anomalies), dated.sigma_ns)

    def _line(self, text: str, arrival_ns: int, anomalies: list[Anomaly]) -> Line | None:
        skips, self._skips_first = self._skips_first, False
        if (
            self._is_header(text, arrival_ns, anomalies)
            or text.startswith("#")
            or skips
            or self.format is None
            or (not self._counted and self._with_units(text) == self.format)
        ):
            return None
        line = self.format.read(text)
        if isinstance(line, str):
            anomalies.append(self._refused(Refused(line, _shown(text)), arrival_ns))
            return None
        self._counted += 1
        if line.time_ns is not None and line.time_ns + self._wraps_ns == self._newest_own_ns:
            anomalies.append(Anomaly(arrival_ns, REPEATED, _shown(text)))
            return None
        if self._relation is None and self.dating is Dating.OWN_CLOCK:
            step_ns = self.format.time_step_ns(text) if line.time_ns is not None else 0.0
            self._relation = ClockRelation(resolution_ns=step_ns)
        return line

    def _refused(self, refused: Refused, arrival_ns: int) -> Anomaly:
        self._counted += refused.lines  # a reading was taken, whatever has become of it
        # Where lines carry a time, the gap in it counts what is lost.
        has_time = self.format is None or self.format.time_unit_ns is not None
        return Anomaly(arrival_ns, refused.reason, refused.example, 0 if has_time else refused.lines)

    def take_units(self, text: str) -> bool:
        """Takes the units of the line below a header; False if it is no such line.

        Raises:
            StreamFailed: It states other units than the header.
        """
        found = self._with_units(text)
        self.format = found or self.format
        return found is not None

    def _with_units(self, text: str) -> LineFormat | None:
        try:
            return None if self.format is None else self.format.with_units(text)
        except ValueError as error:
            raise StreamFailed(f"the units {_shown(text)!r} cannot be used: {error}", _ADVICE) from error

    def _is_header(self, text: str, arrival_ns: int, anomalies: list[Anomaly]) -> bool:
        if not text.lstrip(_BEFORE_TIME).startswith(("time", "Time", "TIME")) and not text.startswith("#"):
            return False
        try:
            announced = LineFormat.of_header(text)
        except ValueError as error:
            raise StreamFailed(f"the header {_shown(text)!r} cannot be used: {error}", _ADVICE) from error
        if announced is None:
            return False
        if self.format is None:
            self.format = announced
        elif announced.columns == self.format.columns:
            anomalies.append(Anomaly(arrival_ns, HEADER_AGAIN, _shown(text)))
        else:
            hint = "check units and columns in the configuration against what the logger sends now"
            raise StreamFailed(f"the logger announces other columns than before: {_shown(text)!r}", hint)
        return True

    def _own_ns(self, line: Line) -> int:
        if line.time_ns is None:
            return round(self._counted * 1e9 / self._rate_hz) if self._rate_hz else 0
        own_ns = line.time_ns + self._wraps_ns
        if self._newest_own_ns is not None and own_ns < self._newest_own_ns:
            assert self.format is not None
            assert self.format.time_unit_ns is not None
            for bits in _COUNTER_BITS:
                wrap_ns = round(2**bits * self.format.time_unit_ns)
                if 0 < own_ns + wrap_ns - self._newest_own_ns < min(_WRAPPED_NS, wrap_ns / 2):
                    self._wraps_ns += wrap_ns
                    own_ns += wrap_ns
                    break
        self._newest_own_ns = own_ns
        return own_ns

    def _date(self, own_ns: "np.ndarray[tuple[int], np.dtype[np.int64]]", arrival_ns: int) -> Dated:
        if self._relation is None:
            return self._arrivals.date(len(own_ns), arrival_ns)
        dated = self._relation.date(own_ns, arrival_ns)
        if self._newest_own_ns is None:
            return dated._replace(anomalies=tuple(map(self._as_missing, dated.anomalies)))
        if dated.anomalies:
            self._missing.begin_anew()
        return dated._replace(anomalies=(*dated.anomalies, *self._missing.look(own_ns, arrival_ns)))

    def _as_missing(self, jump: Anomaly) -> Anomaly:
        """A jump of a clock that counts readings: so many have not come."""
        assert self._rate_hz is not None
        count = round(-float(jump.example.split()[0]) * self._rate_hz)
        return jump._replace(reason=MISSING, example=f"{count} at once", lost=max(count, 0))


_BEFORE_TIME = "\"'# ;,|\t"
"""Characters of a header before its time: quotes, and the nameless head of row names."""
_ADVICE = "write it like 'time_ms,p1 [kPa],p2 [kPa]', or name the columns in the options"


def printable(text: str) -> str:
    """A text whose other characters are replaced."""
    return "".join(char if char.isprintable() else "\ufffd" for char in text)


def _shown(text: str) -> str:
    """Printable part of a line, cut to a length that can be shown."""
    return printable(text) if len(text) <= _SHOWN else printable(text[: _SHOWN - 1]) + "…"
