"""Tables that people bring, as spreadsheets, statistics programs and loggers write them.

    Logger 7, 200 Hz                      preamble: whatever comes before the header; `#` begins a comment
    time_ms;pulsation_vacuum [kPa]        the header: names, with their units in brackets or as a suffix
    ms;kPa                                possibly a line of units
    1000;42,01                            rows, each with as many cells as the header

The header is the line that names the columns sought. Cells are separated as the header separates them, by
one of `SEPARATORS` or by what a line `sep=;` before it says, and quoted as in RFC 4180. All numbers of a
table have the same decimal sign. What could be read in two ways is refused: wrong ones look like right ones.
"""

import csv
import math
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

SEPARATORS = (";", "\t", "|", ",", " ")
"""Where several could separate a line, the first that it contains does."""
MOST_ROWS = 1_000_000
"""Rows of a table: true places of a hundred targets for three minutes."""
MOST_COLUMNS = 1000
LARGEST_NUMBER = 1e30  # of any file or request: its tenth power is a number, too
TIME_UNITS_NS = {"s": 1e9, "ms": 1e6, "us": 1e3, "µs": 1e3, "ns": 1.0}
UNITS = ("kPa", "mbar", "hPa", "Pa", "bar", "mmHg", "Torr", "inHg", "psi", "mV", "V", "mm", "px")
"""Units that a column's name may end with; in brackets any unit may stand."""

_MOST_PREAMBLE = 500
"""Lines among which the header is looked for."""
_MOST_HEAD_LINES = 5
"""Lines of a header whose quoted names have line breaks."""
_SUFFIXES = {unit.lower(): unit for unit in UNITS}
_KNOWN_UNITS = _SUFFIXES | {unit: unit for unit in (*TIME_UNITS_NS, "min", "h", "sec", "cm", "m", "µm")}
_CAMPBELL, _CAMPBELL_TIME = "TOA5", "TS"
"""Beginning of Campbell's files, whose header has a third line, of aggregations; their unit of moments."""
_NO_UNITS = ("", "-", "RN", _CAMPBELL_TIME)
"""Words of a line of units for columns that have none."""
_BRACKETS = re.compile(r"^(?P<name>[^\[\]()]+?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]$", re.DOTALL)
_ONLY_BRACKETS = re.compile(r"\[[^\[\]]+\]|\([^()]+\)")
_BEFORE_UNIT = re.compile(r" +(?=[\[(])")
_LINE = re.compile(r"[^\r\n]*(?:\r\n?|\n|\Z)")
_SEPARATOR_LINE = re.compile(r'^"?sep=(?P<separator>.)"?[;,\t]*$', re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_LIKE_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+", re.ASCII)
_OVER_999 = re.compile(r"[-+]?[1-9]\d{3,}", re.ASCII)
_SEMICOLONS = "separate the cells by semicolons, or write decimal points"
_ONE_SIGN = "write all numbers with the same decimal sign, and none for thousands"


class TableError(ValueError):
    """A table cannot be read; a caller adds the file's name, and `hint` says what to do about it."""

    def __init__(self, message: str, hint: str = "correct or remove the line") -> None:
        super().__init__(message)
        self.hint = hint


class Column(NamedTuple):
    """A column of a header.

    Attributes:
        name: Its name, without a unit in brackets.
        unit: Its unit, or None if the header states none.
    """

    name: str
    unit: str | None

    @classmethod
    def of(cls, cell: str) -> "Column":
        """The column that a cell of a header names."""
        cell = " ".join(cell.split())
        if in_brackets := _BRACKETS.match(cell):
            unit = in_brackets["unit"].strip()
            return cls(in_brackets["name"], _KNOWN_UNITS.get(unit.lower(), unit) or None)
        suffix = cell.rpartition("_")[2].lower()
        is_time = cell.lower().startswith("time_") and suffix in TIME_UNITS_NS
        return cls(cell, suffix if is_time else _SUFFIXES.get(suffix) if "_" in cell else None)

    @property
    def quantity(self) -> str:
        """Quantity that it holds, whatever its unit: `time` of `time_ms` and of `Time [s]`."""
        name = "_".join(self.name.lower().split())
        return name if self.unit is None else name.removesuffix(f"_{self.unit.lower()}")

    @property
    def key(self) -> str:
        """Its quantity and unit, by which readers look for it: `time_ms`, `pulsation_vacuum_kpa`."""
        return self.quantity if self.unit is None else f"{self.quantity}_{self.unit.lower()}"

    @property
    def is_time(self) -> bool:
        """True for a logger's own time."""
        return self.name.lower() == "time" or self.name.lower().removeprefix("time_") in TIME_UNITS_NS


def separator_of(line: str) -> str:
    """Separator of a line's cells: the first of `SEPARATORS` that it contains, else a blank."""
    return next((separator for separator in SEPARATORS if separator in line), " ")


def cells_of(line: str, separator: str, *, is_strict: bool = True) -> list[str]:
    """The cells of a single line, without blanks round them; a run of blanks separates once.

    Unless `is_strict`, quotes may enclose a part of a cell.

    Raises:
        TableError: Its quotes are wrong.
    """
    if '"' not in line:
        return line.split() if separator == " " else [cell.strip() for cell in line.split(separator)]
    try:
        (row,) = csv.reader([line.strip(" ")], delimiter=separator, skipinitialspace=True, strict=is_strict)
    except (csv.Error, ValueError) as error:
        raise TableError(f"it is not CSV: {error}") from error
    return [cell.strip() for cell in row]


def header_cells(line: str, separator: str) -> list[str]:
    """The cells of a line that may be a header; a unit in brackets after a blank belongs to its name."""
    return cells_of(_BEFORE_UNIT.sub("", line) if separator == " " else line, separator, is_strict=False)


def fitted(cells: Sequence[str], count: int) -> Sequence[str]:
    """Cells without the empty ones after so many, as spreadsheets write them at the end of lines."""
    return cells if any(cell.strip() for cell in cells[count:]) else cells[:count]


def number_of(cell: str) -> float | None:
    """The number of a cell, with a decimal point or comma; None if it is none, or too large."""
    value = float(cell.replace(",", ".")) if _NUMBER.fullmatch(cell) else math.inf
    return value if abs(value) <= LARGEST_NUMBER else None


def table_rows(lines: Iterable[str], separator: str, first_line: int = 1) -> Iterator[tuple[int, list[str]]]:
    """The rows of a table that have any content, with the numbers of their last lines; of any size.

    Lines have their ends or not; `first_line` is the number of the first.

    Raises:
        TableError: While they are read: a line is not CSV.
    """
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)
    try:
        for row in reader:
            if any(row) and any(cell.strip() for cell in row):
                yield first_line + reader.line_num - 1, row
    except csv.Error as error:
        raise TableError(f"line {first_line + reader.line_num - 1} is not CSV: {error}") from error


def with_units(
    columns: Sequence[Column], cells: Sequence[str], sought: Callable[[Column], bool]
) -> tuple[Column, ...] | None:
    """Columns with the units that the line below a header states; None if it is no line of units.

    Args:
        columns: The columns.
        cells: Cells of the line.
        sought: Tells whether a column is read; the cells of others may be anything.

    Raises:
        TableError: The line states unknown units, or others than the header.
    """
    if len(cells := fitted(cells, len(columns))) != len(columns):
        return None
    found, problem, is_any = [], "", _CAMPBELL_TIME in cells
    for column, cell in zip(columns, cells, strict=True):
        in_brackets = _ONLY_BRACKETS.fullmatch(cell)
        unit = Column.of(f"x{cell}").unit if in_brackets else _KNOWN_UNITS.get(cell.lower())
        if not sought(column):
            unit = None
        elif number_of(cell) is not None:
            return None
        elif unit is None and cell not in _NO_UNITS:
            problem = problem or f"the unit {cell!r} below the column {column.name} is not known"
        elif unit and column.unit and unit.lower() != column.unit.lower():
            problem = problem or f"the column {column.name} is in {column.unit}, by the line below in {unit}"
        found.append(column._replace(unit=column.unit or unit))
        is_any |= unit is not None
    if is_any and problem:
        raise TableError(problem, "correct the line of units below the header, or remove it")
    return tuple(found) if is_any else None


@dataclass(frozen=True, slots=True)
class Cells:
    """Columns of a table as text, each with a cell for each of K rows.

    Attributes:
        lines: K numbers of the rows' lines.
        columns: Columns by the caller's keys; cells are without blanks round them.
        names: Names of the columns in the header.
        separator: What separated them.
    """

    lines: Sequence[int]
    columns: Mapping[str, list[str]]
    names: Mapping[str, str]
    separator: str

    def numbers(self, keys: Iterable[str], whole: Iterable[str] = ()) -> dict[str, list[float]]:
        """Columns as finite numbers.

        Args:
            keys: Keys of the columns.
            whole: Those that hold whole numbers, which may have leading zeros and show no decimal sign.

        Raises:
            TableError: A cell is not a number, or could be two; the message names its line and column.
        """
        texts = {key: self.columns[key] for key in keys}
        _check_decimal_sign([cell for key, cells in texts.items() if key not in whole for cell in cells])
        return {key: self._numbers(key, cells, is_whole=key in whole) for key, cells in texts.items()}

    def _numbers(self, key: str, cells: list[str], *, is_whole: bool) -> list[float]:
        numbers, name = [], self.names[key]
        for line, cell in zip(self.lines, cells, strict=True):
            value = number_of(cell)
            if value is None:
                raise TableError(f"line {line}: {name} is {cell!r}, not a number")
            if not is_whole and self.separator == "," and cell[0] == "0" and len(cell) > 1 and cell.isdigit():
                raise TableError(
                    f"line {line}: {name} is {cell!r}: decimal commas between commas?", _SEMICOLONS
                )
            numbers.append(value)
        return numbers


def _check_decimal_sign(cells: Sequence[str]) -> None:
    """Checks that all numbers together have one decimal sign.

    Raises:
        TableError: It cannot be told from one for thousands.
    """
    point = next((cell for cell in cells if "." in cell), None)
    commas = [cell for cell in cells if "," in cell]
    if point and commas:
        raise TableError(f"it has both {commas[0]!r} and {point!r}", _ONE_SIGN)
    # `1,000` may be a thousand where no other number shows what a comma means, as beside `42`: decimals have
    # a fixed number and stand in every cell, and without signs for thousands there are four digits.
    is_like_thousands = 0 < len(commas) < len(cells) and all(map(_LIKE_THOUSANDS.fullmatch, commas))
    if is_like_thousands and not any(map(_OVER_999.fullmatch, cells)):
        why = f"it has {commas[0]!r}, which may be a decimal number or over a thousand"
        raise TableError(why, _ONE_SIGN)


class Table:
    """A table whose header has been found.

    Args:
        text: The whole text.
        sought: Columns that have to be there, each by the quantities it may be called: `time`, `timestamp`.
        optional: Quantities of columns that are read where they are there.
        may_count: True to take a nameless first column that counts 1, 2, 3 for the rows' names. A column
            without a name at the end looks the same: only for tables that would be nonsense then.

    Attributes:
        columns: Columns of the header; those of row names may have no name.
        line: Number of the header's line.
        separator: Separator of the cells.

    Raises:
        TableError: Header and line of units contradict each other, or a line `sep=` names no separator.
    """

    def __init__(
        self,
        text: str,
        sought: Sequence[Sequence[str]],
        optional: Sequence[str] = (),
        *,
        may_count: bool = False,
    ) -> None:
        self._text, self._may_count = text.removeprefix("\ufeff"), may_count
        self._sought = {*optional, *(name for one in sought for name in one)}
        head = _find_header(self._text, sought)
        self.columns, self.separator, self.line = head.columns, head.separator, head.line
        self._start, self._next_line = head.end, head.next_line
        self._take_units()

    def place(self, *names: str) -> int | None:
        """Place of the only column with one of these keys or quantities; None if there is none.

        Raises:
            TableError: There are several.
        """
        found = [n for n, column in enumerate(self.columns) if {column.key, column.quantity} & {*names}]
        if len(found) > 1:
            both = " and ".join(self.columns[place].name for place in found)
            raise TableError(f"it has both columns {both}", "keep one of them")
        return found[0] if found else None

    def missing(self, *names: str) -> str:
        """Words for what is missing where columns of these names are not there."""
        has = ", ".join(column.key or "a column without a name" for column in self.columns)
        if not has:
            return f"has no column {', '.join(names)}: it is empty"
        is_headless = all(_NUMBER.fullmatch(column.name) for column in self.columns)
        what = f"no line names its columns, line {self.line} is" if is_headless else f"line {self.line} names"
        return f"has no column {', '.join(names)}: {what} {has}"

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The rows, with the numbers of their lines, each with as many cells as there are columns.

        Raises:
            TableError: While they are read: a line is not CSV, or there are too many rows, columns or cells.
        """
        fit = _Fit(self.columns, self.separator, may_count=self._may_count)
        for number, (line, row) in enumerate(self._raw_rows(fit), 1):
            if number > MOST_ROWS:
                raise TableError(f"it has more than {MOST_ROWS} rows", "cut it to the time of the capture")
            yield line, fit.cells(number, line, row) if fit.has_names or len(row) != fit.count else row

    def cells(self, places: Mapping[str, int]) -> Cells:
        """Some columns, by keys of the caller's.

        Raises:
            TableError: See `rows`.
        """
        lines = array("q")
        columns: dict[str, list[str]] = {key: [] for key in places}
        pairs = [(columns[key], place) for key, place in places.items()]
        for line, row in self.rows():
            lines.append(line)
            for column, place in pairs:
                column.append(row[place].strip())
        names = {key: self.columns[place].name for key, place in places.items()}
        return Cells(lines, columns, names, self.separator)

    def _take_units(self) -> None:
        """Units from the first line below the header that has content, if it is a line of units."""
        lines = islice(_lines(self._text, self._start, self._next_line), _MOST_HEAD_LINES)
        for end, number, line in lines:
            if line.startswith("#") or not line.strip(f"{self.separator} "):
                continue
            try:
                cells = cells_of(line, self.separator)
            except TableError:
                return
            columns = with_units(self.columns, cells, lambda column: column.quantity in self._sought)
            if columns is None:
                return
            after = (end, number)
            if self._text.lstrip('"').startswith(_CAMPBELL):
                after = next(lines, (*after, ""))[:2]
            self.columns, self._start, self._next_line = columns, after[0], after[1] + 1
            return

    def _raw_rows(self, fit: "_Fit") -> Iterator[tuple[int, list[str]]]:
        def lines() -> Iterator[str]:
            for _, _, line in _lines(self._text, self._start, self._next_line):
                fit.line = line
                yield (line.strip() if self.separator == " " else line) + "\n"

        for line, row in table_rows(lines(), self.separator, self._next_line):
            if len(row) > MOST_COLUMNS:
                raise TableError(f"line {line} has more than {MOST_COLUMNS} columns")
            if not (row[0].startswith("#") and fit.line.startswith("#")):
                yield line, row


def keyed_cells(text: str, columns: Sequence[str], optional: Sequence[str] = (), *, hint: str) -> Cells:
    """The columns of a table by their keys, such as `x_mm`; `optional` are read where they are there.

    Raises:
        TableError: Columns are missing, all of which the message names, with this hint; or see `Table`.
    """
    table = Table(text, [(Column.of(key).quantity,) for key in columns], optional)
    places = {key: table.place(key) for key in (*columns, *optional)}
    if missing := [key for key in columns if places[key] is None]:
        raise TableError(f"it {table.missing(*missing)}", hint)
    return table.cells({key: place for key, place in places.items() if place is not None})


class _Fit:
    """Brings rows to the header's number of cells, where it is plain how.

    R writes names of rows without a head of their own: in quotes, or counting 1, 2, 3. Spreadsheets write
    empty cells at the end of the header or of rows.
    """

    def __init__(self, columns: Sequence[Column], separator: str, *, may_count: bool) -> None:
        self.count, self.line, self.has_names = len(columns), "", False
        self._separator, self._may_count = separator, may_count

    def cells(self, number: int, line: int, row: list[str]) -> list[str]:
        """The cells of the columns.

        Args:
            number: Number of the row; the first decides whether rows have names.
            line: Number of its line.
            row: The row.

        Raises:
            TableError: It has more or fewer, as where numbers with decimal commas stand between commas.
        """
        cells = fitted(row, self.count)
        if number == 1:
            self.has_names = len(row) == self.count + 1 and self._is_named(row, is_fitting=cells != row)
        if self.has_names and len(row) == self.count + 1:
            if self._may_count and not self.line.startswith('"') and row[0] != str(number):
                raise TableError(f"line {line} begins with {row[0]!r}, its number would be {number}")
            return row[1:]
        if len(cells) == self.count and not self.has_names:
            return list(cells)
        advice, hint = "", "give every row as many cells as the header"
        if len(row) > self.count and self._separator == "," and "." not in "".join(row):
            advice, hint = ": decimal commas between commas?", _SEMICOLONS
        elif len(row) == self.count + 1:
            advice, hint = ": which of them has no name?", "name every column in the header"
        has = "1 cell" if len(row) == 1 else f"{len(row)} cells"
        raise TableError(f"line {line} has {has}, the header {self.count}{advice}", hint)

    def _is_named(self, row: list[str], *, is_fitting: bool) -> bool:
        is_first = row[0].strip() == "1"
        if self.line.startswith('"'):
            return is_first or not is_fitting
        is_plain = self._separator != "," or "." in "".join(row)  # no decimal commas between commas
        return is_first and is_plain and self._may_count and not is_fitting


class _Header(NamedTuple):
    """A line that may be the header.

    Attributes:
        columns, separator, line: See `Table`.
        end: Where the text goes on.
        next_line: Number of the line there.
    """

    columns: tuple[Column, ...]
    separator: str
    line: int
    end: int
    next_line: int


def _lines(text: str, start: int = 0, number: int = 1) -> Iterator[tuple[int, int, str]]:
    """Lines without their ends: where the next one starts, the line's number, its text."""
    for match in _LINE.finditer(text, start):
        if match.end() > match.start():
            yield match.end(), number, match[0].rstrip("\r\n")
            number += 1


def _find_header(text: str, sought: Sequence[Sequence[str]]) -> _Header:
    """The first line that names all columns sought, else the one that names most of them."""
    best, highest = _Header((), ",", 0, 0, 1), (0, False)
    separators: tuple[str, ...] = SEPARATORS
    for end, number, line in islice(_lines(text), _MOST_PREAMBLE):
        if number == 1 and (stated := _SEPARATOR_LINE.match(line.strip(" "))):
            separators = (stated["separator"],)
            if separators[0] in SEPARATORS:
                continue
            why = f"line 1 names the separator {separators[0]!r}"
            raise TableError(why, "use semicolons, commas or tabs")
        for header in _possible_headers(text, end, number, line, separators):
            quantities = {column.quantity for column in header.columns}
            rank = sum(not quantities.isdisjoint(one) for one in sought), _has_rows(text, header)
            if rank > highest or not best.columns:
                best, highest = header, rank
        if highest[0] == len(sought):
            break
    return best


def _has_rows(text: str, header: _Header) -> bool:
    """True if numbers stand below a line, in as many cells."""
    if len(header.columns) < 2 or any(_NUMBER.fullmatch(column.name) for column in header.columns):
        return False
    below = islice(_lines(text, header.end, header.next_line), 3)
    rows = [[cell.strip() for cell in line.split(header.separator)] for _, _, line in below]
    return any(len(row) == len(header.columns) and any(map(_NUMBER.fullmatch, row)) for row in rows)


def _possible_headers(
    text: str, end: int, number: int, line: str, separators: Sequence[str]
) -> Iterator[_Header]:
    """A line by each of the separators that it contains; names in quotes may have line breaks."""
    if not line.strip("# \t;,|"):
        return
    last = number
    for more_end, more_number, more in islice(_lines(text, end, number + 1), _MOST_HEAD_LINES - 1):
        if line.count('"') % 2 == 0:
            break
        line, end, last = f"{line}\n{more}", more_end, more_number
    line = line.lstrip("#").lstrip(" ")  # a header as a comment; "#" in quotes is a name
    for separator in [one for one in separators if one in line] or separators[:1]:
        try:
            cells = header_cells(line, separator)
        except TableError:
            continue
        named = next((n for n in range(len(cells), 0, -1) if cells[n - 1]), 0)
        if named <= MOST_COLUMNS:
            yield _Header(tuple(map(Column.of, cells[:named])), separator, number, end, last + 1)
