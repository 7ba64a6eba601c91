"""Verification of capture files: what is written is read back at once, and whole files again and again.

Of whole files a daemon does it in a separate process with the lowest priority.
"""

import math
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grabberd.archive.capture.digests import (
    CHANGED,
    END,
    FIELDS,
    Damage,
    Row,
    changed_parts,
    points_prefix,
    readings_prefix,
    row_digest,
    write_row_digests,
)
from grabberd.archive.capture.encodings import quantised
from grabberd.archive.capture.groups import (
    GROUPED,
    PictureGroup,
    PointGroup,
    PointTable,
    measured_points,
    recorded_fields,
)
from grabberd.archive.capture.meta import SEALED, read_meta
from grabberd.archive.capture.reader import CaptureReader, content_of
from grabberd.archive.capture.reading_groups import ReadingGroup, RecordedReadings, decode_readings
from grabberd.archive.capture.recorded_channels import RecordedChannels
from grabberd.archive.capture.schema import connect, reading_errors
from grabberd.core.field import PackedField
from grabberd.core.ledger import Ledger
from grabberd.core.reconstruction.points import Points
from grabberd.errors import CaptureFileError, GrabberdError, StorageError
from grabberd.files.disk import is_disk_error
from grabberd.work.process import HOSTILE, ask_each

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
        if (numbers := reader.run_numbers) != list(runs):
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


_OF_DATABASE = 20
"""Maximum number of problems listed by SQLite."""


class Verification(NamedTuple):
    """Result of verifying a capture file.

    Attributes:
        fields: Number of intact fields.
        points: Number of fields with intact points, summed over all runs.
        readings: Number of intact readings of all channels.
        has_digests: False for files of earlier versions, in which a changed bit may go unnoticed.
        damages: Descriptions of all damage.
    """

    fields: int
    points: int
    readings: int
    has_digests: bool
    damages: list[str]


def verify(path: Path) -> Verification:
    """Reads a sealed capture completely and checks it against its digests.

    Raises:
        CaptureFileError: The file cannot be opened as a capture at all.
        StorageError: The file cannot be read now.
    """
    problems: list[str] = []
    left_out: list[Damage] = []
    runs: list[int] = []
    fields = points = readings = 0
    with closing(connect(path)) as connection:
        # On a capture of several days, statements take longer than the usual limit; here nobody waits.
        connection.longest_s = math.inf
        with _collected(path, problems):
            problems += _of_the_database(connection)
        with _collected(path, problems):
            read_meta(connection)
            problems += [f"{part}: {CHANGED}" for part in changed_parts(connection)]
        with _collected(path, problems):
            runs += [run for (run,) in connection.execute("SELECT run FROM runs ORDER BY run")]
        content = content_of(path, connection, left_out)
        with _collected(path, problems):
            fields = sum(1 for _ in content.fields(0, END))
            problems += content.unaccounted()
        for run in runs:
            with _collected(path, problems):
                points += content.measured(run)
        readings = _readings(path, RecordedChannels(path, connection, left_out), problems)
    damages = [*problems, *(one.in_words for one in left_out)]
    return Verification(fields, points, readings, content.has_digests, damages)


def _readings(path: Path, channels: RecordedChannels, problems: list[str]) -> int:
    """Reads all channels; returns the number of intact readings."""
    count = 0
    with _collected(path, problems):
        found = channels.all
        _ = channels.account  # raises if it is damaged
        for channel in found:
            with _collected(path, problems):
                count += sum(len(group.time_ns) for group in channels.groups(channel))
    return count


@contextmanager
def _collected(path: Path, problems: list[str]) -> Iterator[None]:
    """Adds errors from damaged content or a failing disk to the problems."""
    try:
        with reading_errors(path):
            yield
    except CaptureFileError as error:
        problems.append(f"{error.__cause__ or error.message}")
    except StorageError as error:
        if not is_disk_error(error.__cause__):
            raise  # such as a lock
        problems.append(f"the disk: {error.__cause__}")


def _of_the_database(connection: sqlite3.Connection) -> list[str]:
    # Digests cover the rows that are found; this finds damaged trees, in which rows may not be found.
    rows = connection.execute(f"PRAGMA integrity_check({_OF_DATABASE})").fetchall()
    return [f"the database: {words}" for (words,) in rows if words != "ok"]


CHECK = f"{__name__}:check_file"
"""The function that the low-priority process calls."""
_LONGEST_S, _BYTES_A_SECOND = 600.0, 1_000_000
"""Time limit for a file, plus its size at a tenth of a slow disk's speed, since other programs go first."""
_BEHIND = replace(HOSTILE, niceness=19, is_last=True)


def verify_files(paths: Iterable[Path]) -> Iterator[tuple[Path, Verification]]:
    """Verifies capture files, in order; an unreadable one is damaged.

    Raises:
        StorageError: No process can be started.
    """
    for path, answer in ask_each(_BEHIND, CHECK, paths, _longest_s):
        if answer is None:
            reason = f"reading it ends the reader, or takes longer than {_longest_s(path):.0f} s"
            yield path, Verification(0, 0, 0, has_digests=False, damages=[reason])
        else:
            yield path, Verification(*answer)


def _longest_s(path: Path) -> float:
    size = path.lstat().st_size if path.exists() else 0
    return _LONGEST_S + size / _BYTES_A_SECOND


def check_file(path: Path) -> Verification:
    """Verifies a file without raising errors; called in the separate process."""
    try:
        return verify(path)
    except GrabberdError as error:
        return Verification(0, 0, 0, has_digests=False, damages=[error.message])
    except Exception as error:
        return Verification(0, 0, 0, has_digests=False, damages=[f"{type(error).__name__}: {error}"])
