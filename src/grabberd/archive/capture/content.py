"""Reading fields and points of a capture: the interface for all formats, and format 1.

Format 2 is read by `group_content`.
"""

import sqlite3
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
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
)
from grabberd.archive.capture.encodings import decode_field_points
from grabberd.archive.capture.meta import LARGEST_TIME_NS
from grabberd.archive.capture.rows import FIELD_COLUMNS, RecordedField, recorded_field
from grabberd.archive.capture.schema import reading_errors
from grabberd.core.reconstruction.points import Points


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
