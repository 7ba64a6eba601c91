"""Reading fields and points of a capture: the interface for both formats, and each of them."""

import sqlite3
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import (
    END,
    FIELDS,
    CheckedRows,
    Damage,
    Kind,
    Row,
    points_prefix,
    query_rows,
    some_rows,
)
from grabberd.archive.capture.encodings import COLUMNS, decode_field_points
from grabberd.archive.capture.groups import FIELD_COLUMNS as GROUPED_COLUMNS
from grabberd.archive.capture.groups import (
    MOST_FIELDS,
    NO_COLUMNS,
    PictureGroup,
    PointGroup,
    measured_fields,
    measured_points,
    recorded_fields,
)
from grabberd.archive.capture.meta import LARGEST_TIME_NS
from grabberd.archive.capture.rows import FIELD_COLUMNS, RecordedField, recorded_field
from grabberd.archive.capture.schema import DAMAGE, reading_errors
from grabberd.core.reconstruction.points import Points
from grabberd.errors import count_of
from grabberd.files.reading import check_patience


class PointArrays(NamedTuple):
    """Points of some fields.

    Attributes:
        n: (K,) int64, numbers of the fields, in order.
        time_ns: (K,) int64, their times.
        counts: (K,) int64, number of points of each.
        points: Points of all fields, one field after the other.
    """

    n: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    counts: NDArray[np.int64]
    points: Points

    def by_field(self) -> Iterator[tuple[int, int, Points]]:
        """(n, time_ns, points) of each field."""
        ends = np.cumsum(self.counts).tolist()
        begins = [0, *ends[:-1]]
        for n, time_ns, *ends_of in zip(self.n.tolist(), self.time_ns.tolist(), begins, ends, strict=True):
            yield n, time_ns, _part(self.points, slice(*ends_of))

    def select(self, chosen: NDArray[np.bool_]) -> "PointArrays":
        """Points of the fields selected by a mask."""
        if chosen.all():
            return self
        points = self.points.select(np.repeat(chosen, self.counts))
        return PointArrays(self.n[chosen], self.time_ns[chosen], self.counts[chosen], points)


def _part(points: Points, part: slice) -> Points:
    """Consecutive points, as views."""
    return Points(
        points.target[part],
        points.xyz_mm[part],
        points.covariance_mm2[part],
        points.calibration_covariance_mm2[part],
        points.image_px[part],
        points.residual_px[part],
    )


class Content(ABC):
    """Fields and points of one file; damaged ones are errors, or are skipped and collected in `left_out`."""

    def __init__(self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None) -> None:
        self._keeps = False
        self._path = path
        self._connection = connection
        self._rows = CheckedRows(path, connection, left_out)

    @property
    def has_digests(self) -> bool:
        """False for files of earlier versions, in which a changed bit may go unnoticed."""
        return self._rows.has_digests

    def keep_groups(self) -> None:
        """Caches what was decoded last; only for a file that does not change while it is read."""
        self._keeps = True

    @abstractmethod
    def fields(self, first_n: int, end_n: int) -> Iterator[RecordedField]:
        """The fields with first_n ≤ n < end_n, in order."""

    @abstractmethod
    def points(self, run: int, first_n: int, end_n: int, every: int) -> Iterator[PointArrays]:
        """Points of fields in the file, with first_n ≤ n < end_n and n a multiple of `every`."""

    @abstractmethod
    def check_points(self, run: int, first_n: int, end_n: int) -> None:
        """Checks points against their digests, without decoding them."""

    @abstractmethod
    def point_count(self, run: int, first_n: int, end_n: int, every: int) -> int:
        """Number of points, without reading them."""

    @abstractmethod
    def point_span(self, run: int, first_n: int, end_n: int) -> tuple[int, int]:
        """Number of points of fields in the file, and the number after the last field with points."""

    @abstractmethod
    def measured(self, run: int) -> int:
        """Reads and decodes all points of a run; returns the number of fields with points."""

    def unaccounted(self) -> list[str]:
        """Descriptions of inconsistencies between the tables."""
        return []


ALL_FIELDS = Kind(
    "field",
    query_rows(
        f"SELECT {FIELD_COLUMNS} FROM fields WHERE n >= :first AND n < :end ORDER BY n LIMIT :some"  # noqa: S608 - constants
    ),
)
_POINTS = Kind(
    "points",
    query_rows(
        "SELECT p.n, f.time_ns, p.run, p.count, p.data FROM points AS p JOIN fields AS f ON f.n = p.n "
        "WHERE p.run = :run AND p.n >= :first AND p.n < :end AND p.n % :every = 0 ORDER BY p.n LIMIT :some"
    ),
    stored=lambda row: (row[2], row[0], *row[3:]),
    whole=False,
)
_ALL_POINTS = Kind(
    "points",
    query_rows(
        "SELECT n, run, count, data FROM points WHERE run = :run AND n >= :first AND n < :end "
        "ORDER BY n LIMIT :some"
    ),
    stored=lambda row: (row[1], row[0], *row[2:]),
)


class RowContent(Content):
    """Fields and points of format 1, with one row per field; nothing is cached."""

    def fields(self, first_n: int, end_n: int) -> Iterator[RecordedField]:
        """See `Content`."""
        return self._rows.each(ALL_FIELDS, FIELDS, recorded_field, first_n, end_n)

    def points(self, run: int, first_n: int, end_n: int, every: int) -> Iterator[PointArrays]:
        """See `Content`."""
        prefix = points_prefix(run)
        return self._rows.each(_POINTS, prefix, _point_arrays, first_n, end_n, run=run, every=every)

    def check_points(self, run: int, first_n: int, end_n: int) -> None:
        """See `Content`."""
        rows = self._rows.each(_ALL_POINTS, points_prefix(run), lambda _: None, first_n, end_n, run=run)
        deque(rows, maxlen=0)

    def point_count(self, run: int, first_n: int, end_n: int, every: int) -> int:
        """See `Content`."""
        query = "SELECT coalesce(sum(count), 0) FROM points WHERE run = ? AND n >= ? AND n < ? AND n % ? = 0"
        with reading_errors(self._path):
            return int(self._connection.execute(query, (run, first_n, end_n, every)).fetchone()[0])

    def point_span(self, run: int, first_n: int, end_n: int) -> tuple[int, int]:
        """See `Content`."""
        query = (
            "SELECT coalesce(sum(p.count), 0), coalesce(max(p.n) + 1, 0) FROM points AS p "
            "JOIN fields AS f ON f.n = p.n WHERE p.run = ? AND p.n >= ? AND p.n < ?"
        )
        with reading_errors(self._path):
            count, end = self._connection.execute(query, (run, first_n, end_n)).fetchone()
            return int(count), int(end)

    def measured(self, run: int) -> int:
        """See `Content`."""
        kind = _ALL_POINTS._replace(what="points" if run == 1 else f"points of run {run}")
        return sum(1 for _ in self._rows.each(kind, points_prefix(run), _decoded, 0, END, run=run))


def _decoded(row: Row) -> Points:
    _, _, count, data = row
    return decode_field_points(data, count)


def _point_arrays(row: Row) -> PointArrays:
    n, time_ns, _, count, data = row
    if not isinstance(time_ns, int) or not 0 <= time_ns < LARGEST_TIME_NS:
        raise ValueError(f"time_ns is {time_ns!r}")
    points = decode_field_points(data, count)
    return PointArrays(np.array([n]), np.array([time_ns]), np.array([count]), points)


_AT_ONCE = 2
"""Groups read under one lock: about as many fields as in format 1."""
_LARGEST_COLUMN = 4 << 20
"""Largest column of points in bytes: a little more than the largest valid group takes uncompressed."""


def _bounded(names: Iterable[str]) -> str:
    """SQL for columns that yield NULL if they are too large."""
    return ", ".join(f"CASE WHEN length({name}) <= {_LARGEST_COLUMN} THEN {name} END" for name in names)


_INDEX_COLUMNS = f"run, first_n, last_n, fields, points, {_bounded(('field_n', 'field_points'))}"
_PICTURES = """SELECT first_n, last_n, fields, rows, columns, bits, data FROM pictures
    WHERE first_n >= :first AND first_n < :end ORDER BY first_n LIMIT :some"""
_FIELDS_OF = f"SELECT {GROUPED_COLUMNS} FROM fields WHERE n BETWEEN ? AND ? ORDER BY n LIMIT ?"  # noqa: S608 - constants
_GROUPS_OF_POINTS = f"""SELECT {_INDEX_COLUMNS}, {_bounded(("exact", *COLUMNS))} FROM points
    WHERE run = :run AND first_n >= :first AND first_n < :end ORDER BY first_n LIMIT :some"""  # noqa: S608 - constants
_INDEX = f"""SELECT {_INDEX_COLUMNS} FROM points
    WHERE run = ? AND first_n >= ? AND first_n < ? ORDER BY first_n LIMIT ?"""  # noqa: S608 - constants
_INDEX_AT_ONCE = 500
_PICTURES_START = "SELECT coalesce(max(first_n), 0) FROM pictures WHERE first_n <= ?"
_POINTS_START = "SELECT coalesce(max(first_n), 0) FROM points WHERE first_n <= ? AND run = ?"
_PICTURES_LOST = """SELECT n FROM fields WHERE n >= :first AND n < :end AND n < coalesce(
    (SELECT min(first_n) FROM pictures WHERE first_n > :first), :end) ORDER BY n LIMIT :some"""
_POINTS_LOST = """SELECT n FROM fields WHERE n >= :first AND n < :end AND n < coalesce(
    (SELECT min(first_n) FROM points WHERE first_n > :first AND run = :run), :end)
    AND outcome = 'received' ORDER BY n LIMIT :some"""
WITHOUT_PICTURE = """WHERE f.n > coalesce(
    (SELECT last_n FROM pictures WHERE first_n <= f.n ORDER BY first_n DESC LIMIT 1), -1)"""
_COUNT_WITHOUT_PICTURE = f"SELECT count(*) FROM fields AS f {WITHOUT_PICTURE}"  # noqa: S608 - constants


class _TimedGroup(NamedTuple):
    """Points, and the times of those of their fields that are in the file, by n."""

    points: PointGroup
    times: dict[int, int]


def picture_groups(connection: sqlite3.Connection, values: Mapping[str, int]) -> list[PictureGroup]:
    """Groups of pictures with `first` ≤ first_n < `end`, and the rows of their fields."""
    groups = []
    for row in some_rows(connection.execute(_PICTURES, {**values, "some": _AT_ONCE})):
        recorded = connection.execute(_FIELDS_OF, (*row[:2], MOST_FIELDS + 1)).fetchall()
        groups.append(PictureGroup._make((*row[:-1], recorded, row[-1])))
    return groups


def _timed_groups(connection: sqlite3.Connection, values: Mapping[str, int]) -> list[_TimedGroup]:
    rows = some_rows(connection.execute(_GROUPS_OF_POINTS, {**values, "some": _AT_ONCE}))
    groups = [PointGroup.of(row) for row in rows]
    return [_TimedGroup(group, _times(connection, group)) for group in groups]


def _times(connection: sqlite3.Connection, group: PointGroup) -> dict[int, int]:
    try:
        numbers = measured_fields(group)[0].tolist()
    except DAMAGE:
        return {}  # decoding it will raise the error
    query = f"SELECT n, time_ns FROM fields WHERE n IN ({', '.join('?' * len(numbers))})"  # noqa: S608 - marks
    return dict(connection.execute(query, numbers).fetchall())


def _lost(query: str) -> Callable[[sqlite3.Connection, Mapping[str, int]], list[int]]:
    def lost(connection: sqlite3.Connection, values: Mapping[str, int]) -> list[int]:
        return [n for (n,) in connection.execute(query, {**values, "some": MOST_FIELDS})]

    return lost


PICTURE_GROUPS = Kind("field", picture_groups, lost=_lost(_PICTURES_LOST))
POINT_GROUPS = Kind(
    "points",
    _timed_groups,
    key=lambda row: row.points.first_n,
    stored=lambda row: row.points.digested,
    lost=_lost(_POINTS_LOST),
)


class _RunArrays(NamedTuple):
    """A run and the points of a group; None if none of its fields is in the file."""

    run: int
    arrays: PointArrays | None

    def holds(self, first_n: int, end_n: int) -> bool:
        """True if all fields with first_n ≤ n < end_n are in this group."""
        return self.arrays is not None and _holds(self.arrays.n[[0, -1]].tolist(), first_n, end_n)

    def selected(self, first_n: int, end_n: int, every: int) -> PointArrays | None:
        """The requested points; None if there are none."""
        if self.arrays is None:
            return None
        wanted = _wanted(self.arrays.n, first_n, end_n, every)
        return self.arrays.select(wanted) if wanted.any() else None


class GroupContent(Content):
    """Fields and points of format 2; groups are decoded as a whole, and cached after `keep_groups`."""

    def __init__(self, path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None) -> None:
        super().__init__(path, connection, left_out)
        self._pictures: list[RecordedField] = []
        self._points: _RunArrays | None = None

    def fields(self, first_n: int, end_n: int) -> Iterator[RecordedField]:
        """See `Content`."""
        groups: Iterable[list[RecordedField]] = [self._pictures]
        if not self._pictures or not _holds(
            (self._pictures[0].numbered.n, self._pictures[-1].numbered.n), first_n, end_n
        ):
            wanted = (self._start(_PICTURES_START, first_n), end_n, first_n)
            groups = self._rows.each(PICTURE_GROUPS, FIELDS, recorded_fields, *wanted)
        for group in groups:
            if self._keeps:
                self._pictures = group
            yield from (field for field in group if first_n <= field.numbered.n < end_n)

    def points(self, run: int, first_n: int, end_n: int, every: int) -> Iterator[PointArrays]:
        """See `Content`."""

        def decode(group: _TimedGroup) -> PointArrays | None:
            numbers, _ = measured_fields(group.points)
            if not self._keeps or not _holds(numbers[[0, -1]].tolist(), first_n, end_n):
                return _arrays_of(group, first_n, end_n, every)
            self._points = _RunArrays(run, _arrays_of(group, 0, END, 1))
            return self._points.selected(first_n, end_n, every)

        kept = self._points
        if kept is not None and kept.run == run and kept.holds(first_n, end_n):
            yield from filter(None, [kept.selected(first_n, end_n, every)])
            return
        wanted = (self._start(_POINTS_START, first_n, run), end_n, first_n)
        # Missing groups are found by `check_points`, as in format 1.
        kind = POINT_GROUPS._replace(whole=False)
        yield from filter(None, self._rows.each(kind, points_prefix(run), decode, *wanted, run=run))

    def check_points(self, run: int, first_n: int, end_n: int) -> None:
        """See `Content`."""
        wanted = (self._start(_POINTS_START, first_n, run), end_n, first_n)
        rows = self._rows.each(POINT_GROUPS, points_prefix(run), lambda _: None, *wanted, run=run)
        deque(rows, maxlen=0)

    def point_count(self, run: int, first_n: int, end_n: int, every: int) -> int:
        """See `Content`."""
        return self._counted(run, first_n, end_n, every)[0]

    def point_span(self, run: int, first_n: int, end_n: int) -> tuple[int, int]:
        """See `Content`."""
        with reading_errors(self._path):
            last = self._connection.execute("SELECT coalesce(max(n), -1) FROM fields").fetchone()[0]
        return self._counted(run, first_n, min(end_n, last + 1), 1)

    def measured(self, run: int) -> int:
        """See `Content`."""

        def decode(group: _TimedGroup) -> int:
            measured_points(group.points)
            return len(measured_fields(group.points)[0])

        kind = POINT_GROUPS._replace(what="points" if run == 1 else f"points of run {run}")
        return sum(self._rows.each(kind, points_prefix(run), decode, run=run))

    def unaccounted(self) -> list[str]:
        """See `Content`."""
        with reading_errors(self._path):
            fields = self._connection.execute(_COUNT_WITHOUT_PICTURE).fetchone()[0]
        return [f"{count_of(fields, 'field')} without a picture"] if fields else []

    def _start(self, query: str, *values: int) -> int:
        """First number of the group that a field may be in."""
        with reading_errors(self._path):
            return int(self._connection.execute(query, values).fetchone()[0])

    def _counted(self, run: int, first_n: int, end_n: int, every: int) -> tuple[int, int]:
        """Number of points, and the number after the last field with points."""
        count = end = 0
        for group in self._index(run, self._start(_POINTS_START, first_n, run), end_n):
            with reading_errors(self._path):
                numbers, counts = measured_fields(group)
            wanted = _wanted(numbers, first_n, end_n, every)
            if wanted.any():
                count, end = count + int(counts[wanted].sum()), int(numbers[wanted][-1]) + 1
        return count, end

    def _index(self, run: int, first_n: int, end_n: int) -> Iterator[PointGroup]:
        """The groups of a run without their columns."""
        rows: list[Row] = [()]
        while rows:
            check_patience(self._path.name)
            with reading_errors(self._path):
                rows = self._connection.execute(_INDEX, (run, first_n, end_n, _INDEX_AT_ONCE)).fetchall()
                for row in rows:
                    group = PointGroup._make((*row, NO_COLUMNS))
                    yield group
                    first_n = group.first_n + 1


def _arrays_of(group: _TimedGroup, first_n: int, end_n: int, every: int) -> PointArrays | None:
    """The requested points of a group whose fields are in the file; None if there are none."""
    numbers, counts = measured_fields(group.points)
    times = np.array([_time(group.times.get(n, -1)) for n in numbers.tolist()], np.int64)
    wanted = _wanted(numbers, first_n, end_n, every) & (times >= 0)
    if not wanted.any():
        return None
    return PointArrays(numbers, times, counts, measured_points(group.points)).select(wanted)


def _holds(ends: Sequence[int], first_n: int, end_n: int) -> bool:
    """True if a group with these first and last fields contains all fields with first_n ≤ n < end_n."""
    return ends[0] <= first_n and end_n <= ends[1] + 1


def _wanted(numbers: NDArray[np.int64], first_n: int, end_n: int, every: int) -> NDArray[np.bool_]:
    return (numbers >= first_n) & (numbers < end_n) & (numbers % every == 0)


def _time(time_ns: object) -> int:
    if not isinstance(time_ns, int) or not -1 <= time_ns < LARGEST_TIME_NS:
        raise ValueError(f"time_ns is {time_ns!r}")
    return time_ns
