"""The table of points in both formats: encoding rows, reading them back and checking their digests."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from grabberd.archive.capture.codec import decode_points, encode_points
from grabberd.archive.capture.digests import Row
from grabberd.archive.capture.groups import PointGroup, measured_fields, measured_points, points_in_groups
from grabberd.archive.capture.schema import FORMAT_1
from grabberd.core.reconstruction.points import Points


class PointTable(NamedTuple):
    """The table of points in one format; a row's first cells are the run and its key.

    Attributes:
        key: Name of the column that is unique within a run.
        columns: Number of columns.
        rows_a_commit: Rows per commit, few enough for SQLite's page cache: a transaction that outgrows it
            locks out readers.
        encode: Encodes fields and their points, in order, as rows of a run.
        digested: Returns the form of a row that its digest covers.
        check: Decodes a row.
    """

    key: str
    columns: int
    rows_a_commit: int
    encode: Callable[[int, Iterable[tuple[int, Points]]], Iterator[Row]]
    digested: Callable[[Row], Row]
    check: Callable[[Row], object]

    @property
    def insert(self) -> str:
        """Statement that adds a row."""
        return f"INSERT INTO points VALUES ({', '.join('?' * self.columns)})"  # noqa: S608 - marks

    @property
    def select(self) -> str:
        """Query for the row of a run and a key."""
        return f"SELECT * FROM points WHERE run = ? AND {self.key} = ?"  # noqa: S608 - a constant


def _encode_single(run: int, fields: Iterable[tuple[int, Points]]) -> Iterator[Row]:
    return ((run, int(n), len(points), encode_points(points)) for n, points in fields)


def _encode_groups(run: int, fields: Iterable[tuple[int, Points]]) -> Iterator[Row]:
    return (group.row for group in points_in_groups(run, fields))


def _check_group(row: Row) -> None:
    group = PointGroup.of(row)
    measured_fields(group)
    measured_points(group)


SINGLE = PointTable("n", 4, 500, _encode_single, lambda row: row, lambda row: decode_points(row[3], row[2]))
GROUPED = PointTable("first_n", 14, 10, _encode_groups, lambda row: PointGroup.of(row).digested, _check_group)


def point_table(version: int) -> PointTable:
    """The table in the format of this version."""
    return SINGLE if version == FORMAT_1 else GROUPED
