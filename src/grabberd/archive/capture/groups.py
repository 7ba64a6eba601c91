"""Format 2 of the capture file: groups of fields, compressed in one row each, and the table of points.

A group contains the fields of one commit, half a second at 50 Hz. Invalid rows are errors, never guessed at.
Of the table of points, both formats are written, read back and checked.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture import encodings
from grabberd.archive.capture.digests import Row
from grabberd.archive.capture.meta import LARGEST_N
from grabberd.archive.capture.rows import RecordedField, check_field, check_picture, field_of
from grabberd.archive.capture.schema import FORMAT_1
from grabberd.core.field import NumberedField, PackedField, packed_shape
from grabberd.core.reconstruction.points import Points

FIELD_COLUMNS = "n, time_ns, sequence, parity, y0, y_step, threshold, outcome, reason"
"""Columns in the order of the table."""
_FIELD = tuple(FIELD_COLUMNS.split(", "))
_UINT32 = np.dtype("<u4")
NO_COLUMNS = encodings.PointColumns("", *(b"" for _ in encodings.COLUMNS))
MOST_FIELDS = 32
"""Maximum number of fields of a group; a commit has about 25 at 50 Hz."""
LARGEST_GROUP = 16 << 20
"""Maximum size of a group's pictures in bytes, except for a single field; that of the largest picture."""


class PictureGroup(NamedTuple):
    """A row of the table `pictures`, with the rows of its fields; the digest covers both."""

    first_n: int
    last_n: int
    fields: int
    rows: int
    columns: int
    bits: int
    recorded: Sequence[Row]
    data: bytes

    @property
    def row(self) -> Row:
        """The row itself."""
        return (*self[:6], self.data)


class PointGroup(NamedTuple):
    """A row of the table `points`."""

    run: int
    first_n: int
    last_n: int
    fields: int
    points: int
    field_n: bytes
    field_points: bytes
    columns: encodings.PointColumns

    @property
    def row(self) -> Row:
        """The row itself."""
        return (*self[:7], *self.columns)

    @property
    def digested(self) -> Row:
        """The form that the digest covers: numbers, lengths of the columns, then all their bytes."""
        parts = [self.field_n, self.field_points, *self.columns[1:]]
        return (*self[:5], self.columns.exact, list(map(len, parts)), b"".join(parts))

    @classmethod
    def of(cls, row: Row) -> "PointGroup":
        """The group of a row."""
        return cls._make((*row[:7], encodings.PointColumns._make(row[7:])))


def recorded_fields(group: PictureGroup) -> list[RecordedField]:
    """The fields of a group.

    Raises:
        ValueError: The group is damaged.
    """
    check_picture({name: getattr(group, name) for name in ("rows", "columns", "bits")})
    fields = [dict(zip(_FIELD, row, strict=True)) for row in group.recorded]
    for one in fields:
        check_field(one)
    if len(fields) != group.fields or not fields:
        raise ValueError(f"a group of {group.fields!r} fields has {len(fields)}")
    if (fields[0]["n"], fields[-1]["n"]) != (group.first_n, group.last_n):
        raise ValueError(f"a group of the fields {group.first_n!r} to {group.last_n!r} has others")
    pictures = decode_pictures(group.data, group.fields, group.rows, group.columns, group.bits)
    return [
        field_of(one, data, group.bits, group.columns) for one, data in zip(fields, pictures, strict=True)
    ]


def point_group(run: int, fields: Sequence[tuple[int, Points]]) -> PointGroup:
    """Encodes fields and their points as a group.

    Raises:
        ValueError: The fields are not in order.
    """
    numbers = np.array([n for n, _ in fields], np.int64)
    counts = np.array([len(points) for _, points in fields], _UINT32)
    if (np.diff(numbers) <= 0).any():
        raise ValueError(f"points of fields that are not in order: {numbers.tolist()}")
    first_n, last_n = int(numbers[0]), int(numbers[-1])
    offsets = (numbers - first_n).astype(_UINT32)
    columns = encodings.encode_points([points for _, points in fields])
    ends = (run, first_n, last_n, len(fields), int(counts.sum()))
    return PointGroup(*ends, offsets.tobytes(), counts.tobytes(), columns)


def measured_fields(group: PointGroup) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of a group's fields, and the number of points of each.

    Raises:
        ValueError: The group is damaged.
    """
    # Only integers: `range` tests membership of a float by iterating, which would take forever.
    kinds = {type(group.fields), type(group.first_n)}
    if (
        kinds != {int}
        or group.fields not in range(1, MOST_FIELDS + 1)
        or group.first_n not in range(LARGEST_N)
    ):
        raise ValueError(f"a group of {group.fields!r} fields from {group.first_n!r} on")
    if {len(group.field_n), len(group.field_points)} != {group.fields * _UINT32.itemsize}:
        raise ValueError("a column's length does not match its fields")
    numbers = group.first_n + np.frombuffer(group.field_n, _UINT32).astype(np.int64)
    counts = np.frombuffer(group.field_points, _UINT32).astype(np.int64)
    if (np.diff(numbers) <= 0).any() or (numbers[0], numbers[-1]) != (group.first_n, group.last_n):
        raise ValueError(f"the numbers of its fields are {numbers.tolist()}")
    if counts.sum() != group.points:
        raise ValueError(f"its fields have {counts.sum()} points instead of {group.points!r}")
    return numbers, counts


def measured_points(group: PointGroup) -> Points:
    """The points of a group, one field after the other.

    Raises:
        ValueError: The points are damaged.
    """
    return encodings.decode_points(group.columns, group.points)


def pictures_size(count: int, rows: int, columns: int, bits: int) -> int:
    """Uncompressed size of a number of pictures in bytes."""
    return count * math.prod(packed_shape(rows, columns, bits))


def encode_pictures(fields: Sequence[PackedField]) -> bytes:
    """Encodes pictures of the same size and number of bits.

    Packed planes are written in columns of eight pixels: the edge of a target changes little from line to
    line, which gives long runs of equal bytes and long repetitions from field to field.
    """
    return encodings.frame_of([b"".join(_downward(field).tobytes() for field in fields)])


def _downward(field: PackedField) -> NDArray[np.uint8]:
    return field.data if field.bits == 8 else field.data.swapaxes(1, 2)


def decode_pictures(data: bytes, count: int, rows: int, columns: int, bits: int) -> list[NDArray[np.uint8]]:
    """Decodes pictures into `PackedField.data`, each in its own memory.

    Raises:
        ValueError: The count is out of range, or the bytes are damaged or belong to other pictures.
    """
    size = pictures_size(count, rows, columns, bits)
    if count not in range(1, MOST_FIELDS + 1) or (count > 1 and size > LARGEST_GROUP):
        raise ValueError(f"a group of {count} fields with {size} bytes of pictures")
    planes, lines, across = packed_shape(rows, columns, bits)
    content = np.frombuffer(encodings.unpacked(data, size), np.uint8)
    if bits == 8:
        return [picture.copy() for picture in content.reshape(count, planes, lines, across)]
    pictures = content.reshape(count, planes, across, lines)
    return [np.ascontiguousarray(picture.swapaxes(1, 2)) for picture in pictures]


class PicturesInWaiting:
    """Fields collected for a group.

    Attributes:
        marks: Numbers of those fields whose marks were located, and (K, 3) their places.
    """

    def __init__(self) -> None:
        self._fields: list[Row] = []
        self._packed: list[PackedField] = []
        self.marks: list[tuple[int, NDArray[np.float32]]] = []

    def __len__(self) -> int:
        return len(self._fields)

    def takes(self, packed: PackedField) -> bool:
        """True if a field with this picture may be added."""
        if not self._packed:
            return True
        shape, count = (packed.rows, packed.columns, packed.bits), len(self) + 1
        first = self._packed[0]
        alike = shape == (first.rows, first.columns, first.bits)
        return alike and count <= MOST_FIELDS and pictures_size(count, *shape) <= LARGEST_GROUP

    def add(self, numbered: NumberedField, outcome: str, reason: str | None) -> None:
        """Adds a field."""
        packed = numbered.packed
        sequence = None if numbered.sequence is None else int(numbered.sequence)
        # sqlite3 stores numpy's integers as blobs.
        where = (int(numbered.n), int(numbered.time_ns), sequence, packed.parity, packed.y0, packed.y_step)
        self._fields.append((*where, int(packed.threshold), outcome, reason))
        self._packed.append(packed)
        if packed.marks is not None:
            self.marks.append((int(numbered.n), packed.marks))

    @property
    def newest(self) -> PackedField:
        """The last picture added."""
        return self._packed[-1]

    def group(self) -> PictureGroup:
        """The group of all collected fields."""
        first = self._packed[0]
        shape = (first.rows, first.columns, first.bits)
        ends = (self._fields[0][0], self._fields[-1][0], len(self))
        return PictureGroup(*ends, *shape, self._fields, encode_pictures(self._packed))


class PointsInWaiting:
    """Points of fields of one run, collected for a group."""

    def __init__(self) -> None:
        self._run = 0
        self._fields: list[tuple[int, Points]] = []
        self._count = 0

    def __len__(self) -> int:
        return len(self._fields)

    def takes(self, run: int, points: Points) -> bool:
        """True if a field's points may be added."""
        fit = len(self) < MOST_FIELDS and self._count + len(points) <= encodings.MOST_POINTS
        return not self._fields or (run == self._run and fit)

    def add(self, run: int, n: int, points: Points) -> None:
        """Adds the points of a field."""
        self._run = run
        self._fields.append((int(n), points))
        self._count += len(points)

    @property
    def newest(self) -> Points:
        """The last points added."""
        return self._fields[-1][1]

    def group(self) -> PointGroup:
        """The group of all collected points.

        Raises:
            ValueError: The fields are not in order.
        """
        return point_group(self._run, self._fields)


def points_in_groups(run: int, fields: Iterable[tuple[int, Points]]) -> Iterator[PointGroup]:
    """Groups of consecutive fields and their points."""
    waiting = PointsInWaiting()
    for n, points in fields:
        if not waiting.takes(run, points):
            yield waiting.group()
            waiting = PointsInWaiting()
        waiting.add(run, n, points)
    if waiting:
        yield waiting.group()


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
    return ((run, int(n), len(points), encodings.encode_field_points(points)) for n, points in fields)


def _encode_groups(run: int, fields: Iterable[tuple[int, Points]]) -> Iterator[Row]:
    return (group.row for group in points_in_groups(run, fields))


def _check_group(row: Row) -> None:
    group = PointGroup.of(row)
    measured_fields(group)
    measured_points(group)


SINGLE = PointTable(
    "n", 4, 500, _encode_single, lambda row: row, lambda row: encodings.decode_field_points(row[3], row[2])
)
GROUPED = PointTable("first_n", 14, 10, _encode_groups, lambda row: PointGroup.of(row).digested, _check_group)


def point_table(version: int) -> PointTable:
    """The table in the format of this version."""
    return SINGLE if version == FORMAT_1 else GROUPED
