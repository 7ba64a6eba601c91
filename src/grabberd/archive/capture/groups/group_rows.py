"""Rows of groups as objects; an invalid one is an error, never a guess."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Row
from grabberd.archive.capture.groups.picture_codec import MOST_FIELDS, decode_pictures
from grabberd.archive.capture.groups.point_codec import COLUMNS, PointColumns, decode_points, encode_points
from grabberd.archive.capture.meta import LARGEST_N
from grabberd.archive.capture.rows import RecordedField, check_field, check_picture, text_of
from grabberd.core.field import NumberedField, PackedField
from grabberd.core.ledger import Outcome
from grabberd.core.reconstruction.points import Points

FIELD_COLUMNS = "n, time_ns, sequence, parity, y0, y_step, threshold, outcome, reason"
"""In the order of the table."""
_FIELD = tuple(FIELD_COLUMNS.split(", "))
_UINT32 = np.dtype("<u4")
NO_COLUMNS = PointColumns("", *(b"" for _ in COLUMNS))


class PictureGroup(NamedTuple):
    """A row of the table `pictures`, with the rows of its fields; the digest covers it as it is."""

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
    columns: PointColumns

    @property
    def row(self) -> Row:
        """The row itself."""
        return (*self[:7], *self.columns)

    @property
    def digested(self) -> Row:
        """The numbers, the lengths of the columns and all of their bytes, which the digest covers."""
        parts = [self.field_n, self.field_points, *self.columns[1:]]
        return (*self[:5], self.columns.exact, list(map(len, parts)), b"".join(parts))

    @classmethod
    def of(cls, row: Row) -> "PointGroup":
        """The group of a row."""
        return cls._make((*row[:7], PointColumns._make(row[7:])))


def recorded_fields(group: PictureGroup) -> list[RecordedField]:
    """The fields of a group.

    Raises:
        ValueError: It is damaged.
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
    return [_recorded(one, group, data) for one, data in zip(fields, pictures, strict=True)]


def _recorded(cells: dict[str, Any], group: PictureGroup, data: NDArray[np.uint8]) -> RecordedField:
    image = (cells[name] for name in ("parity", "y0", "y_step", "threshold"))
    packed = PackedField(data, group.bits, group.columns, *image)
    numbered = NumberedField(cells["n"], cells["time_ns"], cells["sequence"], packed)
    return RecordedField(numbered, Outcome(cells["outcome"]), text_of(cells["reason"]))


def point_group(run: int, fields: Sequence[tuple[int, Points]]) -> PointGroup:
    """The group of fields with their points, which are in order.

    Raises:
        ValueError: They are not.
    """
    numbers = np.array([n for n, _ in fields], np.int64)
    counts = np.array([len(points) for _, points in fields], _UINT32)
    if (np.diff(numbers) <= 0).any():
        raise ValueError(f"points of fields that are not in order: {numbers.tolist()}")
    first_n, last_n = int(numbers[0]), int(numbers[-1])
    offsets = (numbers - first_n).astype(_UINT32)
    columns = encode_points([points for _, points in fields])
    ends = (run, first_n, last_n, len(fields), int(counts.sum()))
    return PointGroup(*ends, offsets.tobytes(), counts.tobytes(), columns)


def measured_fields(group: PointGroup) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of a group's fields, and of the points of each.

    Raises:
        ValueError: They are damaged.
    """
    # A number with a fraction would be looked for in the range one by one, for ever.
    kinds = {type(group.fields), type(group.first_n)}
    if (
        kinds != {int}
        or group.fields not in range(1, MOST_FIELDS + 1)
        or group.first_n not in range(LARGEST_N)
    ):
        raise ValueError(f"a group of {group.fields!r} fields from {group.first_n!r} on")
    if {len(group.field_n), len(group.field_points)} != {group.fields * _UINT32.itemsize}:
        raise ValueError("a column has another length than its fields need")
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
        ValueError: They are damaged.
    """
    return decode_points(group.columns, group.points)
