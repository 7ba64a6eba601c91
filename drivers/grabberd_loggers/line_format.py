"""Lines of text from a logger: columns and units from a header, numbers from every other line.

    time_ms,p1 [kPa],p2 [kPa]            # time_s; p1_mbar; p2_mbar
    12005,41.93,0.02                     12,005; 419,3; 0,2

Cells are separated by commas, semicolons, tabs or blanks; where it is not commas, decimal commas are read as
well. A header begins with `time` or `#`; any other line that begins with `#` is a comment. An empty cell,
`-` and `nan` say that a column has no reading.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

TIME_UNITS_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "µs": 1e3, "ns": 1.0}
UNITS = ("kPa", "mbar", "hPa", "Pa", "bar", "mmHg", "Torr", "inHg", "psi", "mV", "V")
"""Units that a column's name may end with; in brackets any unit may stand."""
MOST_COLUMNS = 64
IGNORED = "-"
"""Column whose numbers are not read."""
NOT_A_NUMBER, OTHER_CELLS, NO_TIME = "not a number", "another number of cells", "no time"

_BRACKETS = re.compile(r"^(?P<name>[^\[\]()]+?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]$")
_BEFORE_UNIT = re.compile(r"\s+(?=[\[(])")
_NAME = re.compile(r"^[^\W\d][\w .%/+-]*$")
_ABSENT = frozenset(["", "-", "nan", "NaN", "NAN"])
_SUFFIXES = {unit.lower(): unit for unit in UNITS}


class Column(NamedTuple):
    """A column of a header.

    Attributes:
        name: Its name, without a unit in brackets.
        unit: Its unit, or None if the header states none.
    """

    name: str
    unit: str | None

    @property
    def is_time(self) -> bool:
        """True for the logger's own time."""
        return self.name.lower() == "time" or self.name.lower().removeprefix("time_") in TIME_UNITS_NS

    @classmethod
    def of(cls, cell: str) -> "Column":
        """The column that a cell of a header names."""
        cell = cell.strip()
        in_brackets = _BRACKETS.match(cell)
        if in_brackets:
            return cls(in_brackets["name"], in_brackets["unit"].strip() or None)
        suffix = cell.rpartition("_")[2]
        is_time = cell.lower().startswith("time_") and suffix.lower() in TIME_UNITS_NS
        return cls(
            cell, suffix.lower() if is_time else _SUFFIXES.get(suffix.lower()) if "_" in cell else None
        )


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
        text = _BEFORE_UNIT.sub("", text.strip().lstrip("#").strip())
        if not text:
            return None
        separator = separator_of(text)
        columns = tuple(Column.of(cell) for cell in _cells(text, separator))
        announces = columns[0].is_time or (has_mark and any(column.unit for column in columns))
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
        separator = self.separator or separator_of(text)
        cells = _cells(text, separator)
        if len(cells) != len(self.columns):
            return OTHER_CELLS
        time_ns, values = None, []
        for column, cell in zip(self.columns, cells, strict=True):
            if column.name == IGNORED:
                continue
            value = _number(cell if separator == "," else cell.replace(",", "."))
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
        separator = self.separator or separator_of(text)
        cell = _cells(text, separator)[next(i for i, column in enumerate(self.columns) if column.is_time)]
        decimals = len(cell.replace(",", ".").partition(".")[2])
        return (self.time_unit_ns or 1e9) * 10.0**-decimals


def separator_of(text: str) -> str:
    """Separator of a line's cells: the first of ; tab , that it has, else blanks."""
    return next((separator for separator in (";", "\t", ",") if separator in text), " ")


def _cells(text: str, separator: str) -> list[str]:
    return text.split() if separator == " " else [cell.strip() for cell in text.split(separator)]


def _number(cell: str) -> float | None:
    if cell in _ABSENT:
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        return None
    # Python reads 1_000 and inf as well: neither is a logger's number.
    return value if math.isfinite(value) and "_" not in cell else None


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
