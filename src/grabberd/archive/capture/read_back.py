"""Reading back what was written to a capture file before relying on it."""

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from grabberd.archive.capture.digests import (
    FIELDS,
    Row,
    points_prefix,
    readings_prefix,
    row_digest,
    write_row_digests,
)
from grabberd.archive.capture.groups import (
    PictureGroup,
    PointGroup,
    measured_points,
    recorded_fields,
)
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.point_codec import quantised
from grabberd.archive.capture.point_table import GROUPED, PointTable
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.reading_groups import ReadingGroup, RecordedReadings, decode_readings
from grabberd.archive.capture.schema import reading_errors
from grabberd.core.field import PackedField
from grabberd.core.ledger import Ledger
from grabberd.core.reconstruction.points import Points
from grabberd.errors import CaptureFileError, StorageError

_HINT = (
    "check the disk and the memory of this computer (smartctl, memtest86+), and report it if both are sound"
)
_PICTURES = "SELECT * FROM pictures WHERE first_n = ?"
_READINGS = "SELECT * FROM readings WHERE channel = ? AND number = ?"
_FIELDS = "SELECT * FROM fields WHERE n BETWEEN ? AND ? ORDER BY n"


class Uncommitted:
    """Groups written by a transaction, kept until they are committed and verified.

    All groups are compared with the file byte by byte; the newest field, its points and all readings are also
    decoded as a reader would. Decoding all fields would cost as much as encoding them.
    """

    def __init__(self) -> None:
        self._pictures: list[PictureGroup] = []
        self._points: list[PointGroup] = []
        self._newest_field: PackedField | None = None
        self._newest_points: Points | None = None
        self._readings: list[tuple[ReadingGroup, RecordedReadings]] = []

    def add_pictures(self, group: PictureGroup, newest: PackedField) -> None:
        """Adds a group of fields, with its last picture."""
        self._pictures.append(group)
        self._newest_field = newest

    def add_points(self, group: PointGroup, newest: Points) -> None:
        """Adds a group of points, with those of its last field."""
        self._points.append(group)
        self._newest_points = newest

    def add_readings(self, groups: Sequence[tuple[ReadingGroup, RecordedReadings]]) -> None:
        """Adds groups of readings, with the readings themselves."""
        self._readings += groups

    def write_digests(self, connection: sqlite3.Connection) -> None:
        """Writes the digests of the groups, as the last change before the commit."""
        pictures = {group.first_n: row_digest(group) for group in self._pictures}
        write_row_digests(connection, FIELDS, pictures)
        for run in {group.run for group in self._points}:
            of_run = (group for group in self._points if group.run == run)
            digests = {group.first_n: row_digest(group.digested) for group in of_run}
            write_row_digests(connection, points_prefix(run), digests)
        for channel in {group.channel for group, _ in self._readings}:
            of_channel = (group for group, _ in self._readings if group.channel == channel)
            digests = {group.number: row_digest(group.digested) for group in of_channel}
            write_row_digests(connection, readings_prefix(channel), digests)

    def forget(self) -> None:
        """Drops all groups, after a rollback or after reading back."""
        self._pictures, self._points, self._readings = [], [], []
        self._newest_field = self._newest_points = None

    def read_back(self, path: Path, connection: sqlite3.Connection) -> None:
        """Verifies and drops all groups, right after the commit.

        Uses the writer's own connection: another one would need file descriptors, which a busy daemon may
        lack, and would find the same pages in memory.

        Raises:
            StorageError: The file differs from what was written.
        """
        pictures, newest_field = self._pictures, self._newest_field
        points, newest_points = self._points, self._newest_points
        readings = self._readings
        self.forget()  # before the check, so that a difference is reported only once
        with _mismatches(path), reading_errors(path):
            if newest_field is not None:
                _check_pictures(path, connection, pictures, newest_field)
            if newest_points is not None:
                _check_points(path, connection, points, newest_points)
            _check_readings(path, connection, readings)


def check_sealed(path: Path, ledger: Ledger, *, complete: bool, runs: Sequence[int]) -> None:
    """Reads a file as its next reader will: verdict, ledger, runs, and the first and last field.

    Args:
        path: The closed file.
        ledger: The ledger written.
        complete: The verdict written.
        runs: Numbers of the runs written.

    Raises:
        StorageError: The file differs from what was written, or cannot be read.
    """
    with _mismatches(path), CaptureReader(path) as reader:
        meta, found = reader.meta, reader.ledger
        if (meta.state, meta.complete) != (SEALED, complete):
            raise _mismatch(path, f"its state is {meta.state!r}, complete: {meta.complete}")
        if (found.received, found.entries) != (ledger.received, ledger.entries):
            raise _mismatch(path, f"its ledger says {found.in_words(meta.rate_hz)!r}")
        if (numbers := [run.run for run in reader.runs]) != list(runs):
            raise _mismatch(path, f"it has the runs {numbers} instead of {list(runs)}")
        reader.check_unchanged()
        next(reader.fields(), None)
        if (last := reader.last_field) is not None:
            reader.field(last[0])


def check_staged(
    path: Path, connection: sqlite3.Connection, table: PointTable, staged: Iterable[Row]
) -> None:
    """Verifies the points of a run that were copied from a temporary file, before the run is added.

    Args:
        path: The capture file.
        connection: The connection that wrote them.
        table: The table that they were written to.
        staged: The rows of the temporary file.

    Raises:
        StorageError: Some points are missing, differ, or cannot be decoded.
    """
    with _mismatches(path), reading_errors(path):
        for row in staged:
            if connection.execute(table.select, row[:2]).fetchall() != [row]:
                raise _mismatch(path, f"the points of field {row[1]} differ")
            table.check(row)


def _check_pictures(
    path: Path, connection: sqlite3.Connection, groups: Sequence[PictureGroup], newest: PackedField
) -> None:
    for group in groups:
        fields = connection.execute(_FIELDS, group[:2]).fetchall()
        for row in group.recorded:
            if row not in fields:
                raise _mismatch(path, f"field {row[0]} differs")
        if connection.execute(_PICTURES, group[:1]).fetchall() != [group.row]:
            raise _mismatch(path, f"the pictures of the fields {group.first_n} to {group.last_n} differ")
    back = recorded_fields(groups[-1])[-1].numbered
    if not np.array_equal(back.packed.data, newest.data):
        raise _mismatch(path, f"field {back.n} differs")


def _check_points(
    path: Path, connection: sqlite3.Connection, groups: Sequence[PointGroup], newest: Points
) -> None:
    for group in groups:
        if connection.execute(GROUPED.select, group[:2]).fetchall() != [group.row]:
            raise _mismatch(path, f"the points of the fields {group.first_n} to {group.last_n} differ")
    expected, back = quantised(newest), measured_points(groups[-1])
    if back.xyz_mm[len(back) - len(newest) :].tobytes() != expected.xyz_mm.tobytes():
        raise _mismatch(path, f"the points of field {groups[-1].last_n} differ")


def _check_readings(
    path: Path, connection: sqlite3.Connection, groups: Sequence[tuple[ReadingGroup, RecordedReadings]]
) -> None:
    """Verifies groups of readings, decoding all of them, as there are few."""
    for group, readings in groups:
        found = connection.execute(_READINGS, group[:2]).fetchall()
        back = decode_readings(group)
        pairs = ((back.time_ns, readings.time_ns), (back.value, readings.value))
        if found != [group] or any(one.tobytes() != other.tobytes() for one, other in pairs):
            raise _mismatch(path, f"group {group.number} of the readings of channel {group.channel} differs")


@contextmanager
def _mismatches(path: Path) -> Iterator[None]:
    """Turns errors of a reader into errors of the writer."""
    try:
        yield
    except CaptureFileError as error:
        raise _mismatch(path, error.message) from error


def _mismatch(path: Path, what: str) -> StorageError:
    return StorageError(f"{path.name} does not read back as it was written: {what}", _HINT)
