"""Points of known position in other programs' lists: DBAT's control points, OpenPTV's calibration points.

A list is read only where it can be read in one way: a number in the second cell may be a name or X, and three
numbers after it a position, or two coordinates and a σ. A header, which DBAT skips as a comment, decides.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.errors import InputError, count_of
from grabberd.tables import LARGEST_NUMBER

_KIND = "check that the file is complete, and of the kind that is read"
_LARGEST = (1 << 31) - 1


class Lines:
    """Lines of a text, read one by one.

    Attributes:
        what: Description of the text for messages.
        number: Number of the line read last, from 1.
    """

    def __init__(self, text: str, what: str) -> None:
        self.what = what
        self.number = 0
        self._lines = text.removeprefix("\ufeff").splitlines()  # spreadsheets begin a file with a mark

    def refusal(self, why: str, hint: str = _KIND) -> InputError:
        """Error for the line read last, or for the text as a whole before the first."""
        place = f", line {self.number}" if self.number else ""
        return InputError(f"{self.what}{place}: {why}", hint)

    def next(self) -> str:
        """Read a line.

        Raises:
            InputError: There is none left.
        """
        if self.number >= len(self._lines):
            raise InputError(f"{self.what} ends after line {self.number}", "check that the file is complete")
        self.number += 1
        return self._lines[self.number - 1].strip()

    def numbers(self, least: int) -> list[float]:
        """Read the numbers of a line.

        Raises:
            InputError: There are fewer than `least`, or something else.
        """
        return self.as_numbers(self.next().split(), least)

    def as_numbers(self, words: Sequence[str], least: int, most: int | None = None) -> list[float]:
        """Convert the words of the line read last.

        Raises:
            InputError: There are fewer than `least` or more than `most`, or one is not a finite number.
        """
        if not least <= len(words) <= (most or len(words)) or not all(map(_is_number, words)):
            expected = "a number" if least == 1 else f"{least} numbers"
            raise self.refusal(f"expected {expected}, found {' '.join(words)[:60]!r}")
        values = [float(word) for word in words]
        for word, value in zip(words, values, strict=True):
            if not abs(value) <= LARGEST_NUMBER:
                raise self.refusal(
                    f"{word} is not a finite number, or too large", "correct this line, or leave it out"
                )
        return values

    def whole(self, value: float, what: str) -> int:
        """Convert a number of the line read last.

        Raises:
            InputError: It is not a whole number of 32 bits.
        """
        if value != int(value) or abs(value) > _LARGEST:
            raise self.refusal(f"{what} {value:g} is not a whole number", "number them 1, 2, 3 …")
        return int(value)

    def new(self, value: float, what: str, seen: dict[int, int]) -> int:
        """Convert an id of the line read last, and note its line in `seen`, which holds those so far.

        Raises:
            InputError: It is not a whole number, or was given before.
        """
        one = self.whole(value, what)
        if one in seen:
            raise self.refusal(f"{what} {one} is given in line {seen[one]} already", "give each of them once")
        seen[one] = self.number
        return one

    def sigma(self, values: Sequence[float]) -> Sequence[float]:
        """Check standard deviations of the line read last.

        Raises:
            InputError: One is negative.
        """
        if negative := [value for value in values if value < 0]:
            why = f"the standard deviation {negative[0]:g} is negative"
            raise self.refusal(why, "give 0 for a held point")
        return values

    def rest(self) -> Iterator[str]:
        """Read the other lines; those that are empty or begin with # are skipped."""
        while self.number < len(self._lines):
            line = self.next()
            if line and not line.startswith("#"):
                yield line

    def with_header(self, header: str) -> str:
        """The text with a header in place of its comments, in the same lines if it begins with one."""
        lines = ["" if line.lstrip().startswith("#") else line for line in self._lines]
        return "\n".join([header, *(lines[1:] if lines and not lines[0] else lines)])

    def comments(self) -> Iterator[str]:
        """Read the lines that begin with #, without it."""
        while self.number < len(self._lines):
            line = self.next()
            if line.startswith("#"):
                yield line.lstrip("#").strip()

    def block(self, least: int) -> Iterator[list[float]]:
        """Read lines of numbers up to an empty line or the end."""
        while self.number < len(self._lines) and (line := self.next()):
            yield self.as_numbers(line.split(), least)

    def by_id(self, what: str, least: int) -> Iterator[tuple[int, list[float]]]:
        """Read the same, each line by its first number, an id that `new` takes, and the others."""
        seen: dict[int, int] = {}
        for number, *others in self.block(least):
            yield self.new(number, what, seen), others


def _is_number(word: str) -> bool:
    """True for what stands for a number, NaN and infinity too; Python takes 1_000 as well."""
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def read_calibration_points(text: str) -> tuple[NDArray[np.int32], Array]:
    """Read the known points of OpenPTV's calibration body: ids (N,) and positions (N, 3) in mm.

    Raises:
        InputError: A line is something else, or gives an id again; the message says which.
    """
    lines, seen = Lines(text, "the file of calibration points"), dict[int, int]()
    places = []
    for line in lines.rest():
        number, *place = lines.as_numbers(line.split(), 4, 4)
        lines.new(number, "calibration point", seen)
        places.append(place)
    return np.array(list(seen), np.int32), np.array(places, np.float64).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class ControlPoint:
    """A point of known position.

    Attributes:
        xyz_mm: Position.
        sigma_mm: Standard deviation of each coordinate, 0 if held.
    """

    xyz_mm: tuple[float, float, float]
    sigma_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


_PLACE = ("x", "y", "z")
_SIGMAS: Mapping[tuple[str, ...], tuple[int, int, int]] = {
    ("s",): (0, 0, 0),
    ("sxy", "sz"): (0, 0, 1),
    ("sx", "sy", "sz"): (0, 1, 2),
}
"""Standard deviations that a line may give, and which of them is that of X, Y and Z."""
_COVARIANCE = 9
_COUNTS = (0, *map(len, _SIGMAS), _COVARIANCE)
_MM = {"m": 1000.0, "cm": 10.0, "mm": 1.0}
_SYNONYMS = {"no": "id", "nr": "id", "number": "id", "label": "name"}
_SURVEYED = {
    **dict.fromkeys(("e", "east", "easting"), "x"),
    **dict.fromkeys(("n", "north", "northing"), "y"),
    **dict.fromkeys(("h", "height", "elevation"), "z"),
}
"""Surveyors' names of the axes, of which the first two are often exchanged."""
_COLUMN = re.compile(r"(?P<sigma>s|std|sd|sigma|σ)[ _]?(?P<axes>|xyz|xy|[xyz])")
_UNIT = re.compile(r"\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]")
_SUFFIX = re.compile(r"(?<=\w)_(mm|cm|m)\b", re.IGNORECASE)
_OTHER_UNIT = re.compile(
    r"(?<![^\W_])(?:[mcµu]m|(?:milli|centi|micro)met\w+|microns?|inch\w*|f(?:oo|ee)?t)\b", re.IGNORECASE
)
_WRITE = (
    "write a header, '# id, name, X, Y, Z, sigma' or '# id, X, Y, Z (mm)', that names the cells of each line"
)
_NAME_SIGMAS = (
    "write decimal points; or, if they are standard deviations, a header that names them, such as "
    "'# id, name, X, Y, Z, sx, sy, sz (mm)'"
)
_CELLS = "give none (held), one, two (XY and Z) or three standard deviations, or a covariance of nine numbers"


def read_control_points(text: str) -> dict[int, ControlPoint]:
    """Read control points as DBAT keeps them, by id.

    A line is `id, name, X, Y, Z`, with or without the name, and after it no σ (held), one, two (XY and Z) or
    three, or a covariance of nine numbers, which has to be diagonal. A comment that names columns, such as
    `# id, X, Y, Z, sigma (mm)`, is a header: it gives their order and their unit, which is m by default.

    Raises:
        InputError: A line is something else, can be read in two ways, gives an id again or what is no
            standard deviation, or states no position in the unit of the list; the message says which.
    """
    named, unit_mm = _header(Lines(text, _WHAT))
    lines = Lines(text, _WHAT)
    rows = [(lines.number, [cell.strip() for cell in line.split(",")]) for line in lines.rest()]
    if not rows:
        raise InputError(f"{_WHAT} holds no points", "give a line for each: id, name, X, Y, Z")
    columns = _columns(lines, rows, named)
    _check_decimal_commas(lines, rows, columns)
    seen: dict[int, int] = {}
    points = []
    for lines.number, cells in rows:
        points.append(_point(lines, cells, columns, unit_mm))
        lines.new(lines.as_numbers([cells[columns.index("id")]], 1)[0], "control point", seen)
    _check_sigmas(lines, points, list(seen.values()))
    return dict(zip(seen, points, strict=True))


_WHAT = "the list of control points"


def _header(lines: Lines) -> tuple[tuple[str, ...], float]:
    """The columns that a comment names, none if no comment does, and the list's unit in mm."""
    columns: tuple[str, ...] = ()
    unit, foreign = "", None
    for comment in lines.comments():
        text = _SUFFIX.sub(lambda suffix: f" ({suffix[1].lower()})", comment)
        units = set(_UNIT.findall(text))
        words = [word.strip().lower() for word in _UNIT.sub("", text).split("," if "," in text else None)]
        if not set(_PLACE) & set(words):
            words = [_SURVEYED.get(word, word) for word in words]
        if not set(_PLACE) <= set(words):
            if other := _OTHER_UNIT.search(text):
                foreign = foreign or lines.refusal(f"this says {other[0]}, and no header says so", _WRITE)
            continue
        if columns:
            raise lines.refusal("this is a second header", "keep the one that is right")
        if len(units) > 1 or not units <= _MM.keys():
            stated = ", ".join(sorted(units))
            raise lines.refusal(f"the header states the units {stated}", f"state one of {', '.join(_MM)}")
        columns, unit = _named(lines, words), "".join(units)
    if foreign and not unit:
        raise foreign
    return columns, _MM[unit or "m"]


def _named(lines: Lines, words: Sequence[str]) -> tuple[str, ...]:
    """The columns of a header by its words."""
    columns = []
    for word in words:
        sigma = _COLUMN.fullmatch(word)
        one = "s" + sigma["axes"].replace("xyz", "") if sigma else _SYNONYMS.get(word, word)
        if one not in ("id", "name", *_PLACE) and not sigma:
            raise lines.refusal(f"{word!r} in the header is none of id, name, X, Y, Z and sigma", _WRITE)
        if one in columns:
            raise lines.refusal(f"the header names {word!r} twice", _WRITE)
        columns.append(one)
    sigmas = tuple(one for one in columns if one.startswith("s"))
    if "id" not in columns:
        raise lines.refusal("the header names no id", _WRITE)
    if sigmas and sigmas not in _SIGMAS:
        hint = "name sigma; or sigma_xy and sigma_z; or sigma_x, sigma_y and sigma_z"
        raise lines.refusal(f"the header names {', '.join(words)}, of which not every axis has one σ", hint)
    return tuple(columns)


def _columns(lines: Lines, rows: Sequence[tuple[int, list[str]]], stated: tuple[str, ...]) -> tuple[str, ...]:
    """The columns of the rows: with the names that a header leaves out, or found by the second cells."""
    plain, named = ("id", *_PLACE), ("id", "name", *_PLACE)
    texts = [len(cells) > 1 and not _is_number(cells[1]) for _, cells in rows]
    # DBAT's own list of its calibration sheet has names, and a header without.
    if all(texts) and stated in ((), plain):
        return named
    if stated:
        return stated
    counts = {len(cells) for _, cells in rows}
    fits = [columns for columns in (plain, named) if counts <= {len(columns) + more for more in _COUNTS}]
    if len(fits) < 2:
        return fits[0] if fits else plain
    lines.number, cells = rows[texts.index(True) if any(texts) else 0]
    where = "here, and a number in other lines" if any(texts) else "in every line"
    kind = repr(cells[1]) if any(texts) else "a number"
    raise lines.refusal(f"the second cell is {kind} {where}: it may be a name or X", _WRITE)


def _check_decimal_commas(
    lines: Lines, rows: Sequence[tuple[int, list[str]]], columns: Sequence[str]
) -> None:
    """Check that cells after the position are no decimals: 100,5 between commas gives a cell more."""
    longest = max(len(cells) for _, cells in rows)
    is_whole = all(cell.lstrip("-").isdecimal() for _, cells in rows for cell in cells[len(columns) :])
    has_point = any("." in cell for _, cells in rows for cell in cells)
    if any(one.startswith("s") for one in columns) or has_point or not is_whole:
        return
    if len(columns) < longest <= len(columns) + len(_PLACE):
        lines.number = next(number for number, cells in rows if len(cells) == longest)
        raise lines.refusal(
            f"{longest} cells, and no decimal point in any line: decimal commas between commas?", _NAME_SIGMAS
        )


def _point(lines: Lines, cells: Sequence[str], columns: Sequence[str], unit_mm: float) -> ControlPoint:
    """The point of the row read last; as in DBAT, one without the σ of the last columns is held."""
    stated = [one for one in columns if one.startswith("s")]
    without = columns[: len(columns) - len(stated)]
    if stated and len(cells) == len(without) and columns[-1] == stated[-1]:
        columns, stated = without, []
    given = cells[len(columns) :]
    if len(cells) < len(columns) or len(given) not in ((0,) if stated else _COUNTS):
        names = ", ".join(one.upper() if one in _PLACE else one for one in columns)
        count = count_of(len(cells), "cell")
        raise lines.refusal(f"{count} between commas, where {names} are expected", _CELLS)
    numbers = lines.as_numbers([cells[columns.index(axis)] for axis in _PLACE], 3)
    if stated:
        given = [cells[columns.index(one)] for one in stated]
    values = lines.as_numbers(given, len(given))
    if len(values) == _COVARIANCE:
        sigma = _of_covariance(lines, np.array(values).reshape(3, 3))
    else:
        lines.sigma(values)
        order = next((places for names, places in _SIGMAS.items() if len(names) == len(values)), None)
        sigma = [0.0] * 3 if order is None else [values[place] for place in order]
    x, y, z, sx, sy, sz = (unit_mm * value for value in (*numbers, *sigma))
    return ControlPoint((x, y, z), (sx, sy, sz))


def _of_covariance(lines: Lines, covariance: Array) -> Sequence[float]:
    """Standard deviations of a covariance (3, 3) in the list's unit squared."""
    rounding = 1e-6 * np.abs(covariance).max()
    if np.abs(covariance - covariance.T).max() > rounding:
        raise lines.refusal("the covariance is not symmetric", "give its nine numbers row by row")
    if np.linalg.eigvalsh(covariance).min() < -rounding:
        why = "the covariance has a negative variance in some direction"
        raise lines.refusal(why, "correct its nine numbers")
    if np.abs(covariance - np.diag(np.diag(covariance))).max() > rounding:
        why = "the coordinates are correlated, and the adjustment takes a standard deviation for each"
        raise lines.refusal(why, "give three standard deviations in place of the covariance")
    deviations: list[float] = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    return deviations


def _check_sigmas(lines: Lines, points: Sequence[ControlPoint], numbers: Sequence[int]) -> None:
    """Check that no σ is larger than the whole list: it would be in another unit than the positions."""
    extent_mm = float(np.ptp([point.xyz_mm for point in points], axis=0).max())
    for lines.number, point in zip(numbers, points, strict=True):
        largest_mm = max(point.sigma_mm)
        if extent_mm < largest_mm and len(points) > 1:
            why = f"a standard deviation of {largest_mm:g} mm, and all points lie within {extent_mm:g} mm"
            hint = "give positions and standard deviations in one unit: m, or the one in the header"
            raise lines.refusal(why, hint)
