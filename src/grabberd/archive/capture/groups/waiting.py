"""Fields and points that wait until they are enough for a group."""

from collections.abc import Iterable, Iterator

from grabberd.archive.capture.codec import MOST_POINTS
from grabberd.archive.capture.digests import Row
from grabberd.archive.capture.groups.group_rows import PictureGroup, PointGroup, point_group
from grabberd.archive.capture.groups.picture_codec import (
    LARGEST_GROUP,
    MOST_FIELDS,
    encode_pictures,
    pictures_size,
)
from grabberd.core.field import NumberedField, PackedField
from grabberd.core.reconstruction.points import Points


class PicturesInWaiting:
    """Fields that are to become a group."""

    def __init__(self) -> None:
        self._fields: list[Row] = []
        self._packed: list[PackedField] = []

    def __len__(self) -> int:
        return len(self._fields)

    def takes(self, packed: PackedField) -> bool:
        """True if a field of this picture may be added to the others."""
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

    @property
    def newest(self) -> PackedField:
        """The picture that was added last."""
        return self._packed[-1]

    def group(self) -> PictureGroup:
        """The group of all of them."""
        first = self._packed[0]
        shape = (first.rows, first.columns, first.bits)
        ends = (self._fields[0][0], self._fields[-1][0], len(self))
        return PictureGroup(*ends, *shape, self._fields, encode_pictures(self._packed))


class PointsInWaiting:
    """Points of fields of one run that are to become a group."""

    def __init__(self) -> None:
        self._run = 0
        self._fields: list[tuple[int, Points]] = []
        self._count = 0

    def __len__(self) -> int:
        return len(self._fields)

    def takes(self, run: int, points: Points) -> bool:
        """True if a field's points may be added to the others."""
        fit = len(self) < MOST_FIELDS and self._count + len(points) <= MOST_POINTS
        return not self._fields or (run == self._run and fit)

    def add(self, run: int, n: int, points: Points) -> None:
        """Adds the points of a field."""
        self._run = run
        self._fields.append((int(n), points))
        self._count += len(points)

    @property
    def newest(self) -> Points:
        """The points that were added last."""
        return self._fields[-1][1]

    def group(self) -> PointGroup:
        """The group of all of them.

        Raises:
            ValueError: Their fields are not in order.
        """
        return point_group(self._run, self._fields)


def points_in_groups(run: int, fields: Iterable[tuple[int, Points]]) -> Iterator[PointGroup]:
    """Groups of fields with their points, which are in order."""
    waiting = PointsInWaiting()
    for n, points in fields:
        if not waiting.takes(run, points):
            yield waiting.group()
            waiting = PointsInWaiting()
        waiting.add(run, n, points)
    if waiting:
        yield waiting.group()
