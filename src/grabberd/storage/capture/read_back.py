"""Reading back what was written to a capture file, before anybody relies on it."""

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from grabberd.acquisition import Ledger
from grabberd.errors import CaptureFileError, StorageError
from grabberd.field import PackedField
from grabberd.reconstruction.points import Points
from grabberd.storage.capture.codec import decode_points
from grabberd.storage.capture.digests import FIELDS, points_prefix, row_digest, write_row_digests
from grabberd.storage.capture.meta import SEALED
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.capture.rows import FIELD_COLUMNS, recorded_field
from grabberd.storage.capture.schema import reading_errors

_HINT = (
    "check the disk and the memory of this computer (smartctl, memtest86+), and report it if both are sound"
)
_FIELDS = "SELECT * FROM fields WHERE n BETWEEN ? AND ? ORDER BY n"
_POINTS = "SELECT * FROM points WHERE run = ? AND n BETWEEN ? AND ? ORDER BY n"
_DECODED_FIELD = f"SELECT {FIELD_COLUMNS} FROM fields WHERE n = ?"  # noqa: S608 - constants

Row = tuple[Any, ...]


class Uncommitted:
    """Rows that a transaction has written, kept until it is committed and they are found in the file.

    All are compared with what the file gives back, byte by byte; the newest field and its points are also
    decoded, as a reader would. Decoding all of them would cost as much as encoding them.
    """

    def __init__(self) -> None:
        self._fields: list[Row] = []
        self._points: list[Row] = []
        self._newest_field: PackedField | None = None
        self._newest_points: Points | None = None

    def add_field(self, row: Row, packed: PackedField) -> None:
        """Notes a row of the table `fields`, and the picture that it was made from."""
        self._fields.append(row)
        self._newest_field = packed

    def add_points(self, row: Row, points: Points) -> None:
        """Notes a row of the table `points`, and the points that it was made from."""
        self._points.append(row)
        self._newest_points = points

    def write_digests(self, connection: sqlite3.Connection) -> None:
        """Writes the digests of the rows, as the last change before they are committed."""
        write_row_digests(connection, FIELDS, {row[0]: row_digest(row) for row in self._fields})
        for run in {row[0] for row in self._points}:
            digests = {row[1]: row_digest(row) for row in self._points if row[0] == run}
            write_row_digests(connection, points_prefix(run), digests)

    def forget(self) -> None:
        """Drops everything: the transaction was rolled back, or has been read back."""
        self._fields, self._points = [], []
        self._newest_field = self._newest_points = None

    def read_back(self, path: Path, connection: sqlite3.Connection) -> None:
        """Reads all of it once, right after the commit, and forgets it.

        The writer's own connection does it: another one would need file descriptors, of which a busy daemon
        may have none left, and would find the same pages in memory.

        Raises:
            StorageError: Something is not in the file as it was written.
        """
        fields, newest_field = self._fields, self._newest_field
        points, newest_points = self._points, self._newest_points
        self.forget()  # before it is checked: what does not come back is told of once
        with _mismatches(path), reading_errors(path):
            if newest_field is not None:
                _check_fields(path, connection, fields, newest_field)
            if newest_points is not None:
                _check_points(path, connection, points, newest_points)


def check_sealed(path: Path, ledger: Ledger, *, complete: bool, runs: Sequence[int]) -> None:
    """Reads a file as its first reader will: verdict, ledger, runs, and the first and last field.

    Args:
        path: The file, closed.
        ledger: Ledger that was written.
        complete: Verdict that was written.
        runs: Numbers of the runs that were written.

    Raises:
        StorageError: The file says something else, or cannot be read.
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
    path: Path, connection: sqlite3.Connection, run: int, staged: Iterable[tuple[int, int, bytes]]
) -> None:
    """Finds the points of a run that was copied from a temporary file, before the run is entered.

    Args:
        path: The capture file.
        connection: The connection that wrote them.
        run: Number of the run.
        staged: (n, points, bytes) of every field in the temporary file.

    Raises:
        StorageError: Some are missing, differ, or cannot be decoded.
    """
    with _mismatches(path), reading_errors(path):
        for n, count, data in staged:
            found = connection.execute(_POINTS, (run, n, n)).fetchall()
            _compare(path, "the points of field", [(run, n, count, data)], found, key=1)
            decode_points(data, count)


def _check_fields(
    path: Path, connection: sqlite3.Connection, rows: Sequence[Row], newest: PackedField
) -> None:
    first_n, last_n = rows[0][0], rows[-1][0]
    _compare(path, "field", rows, connection.execute(_FIELDS, (first_n, last_n)).fetchall(), key=0)
    back = recorded_field(connection.execute(_DECODED_FIELD, (last_n,)).fetchone()).numbered.packed
    if not np.array_equal(back.data, newest.data):
        raise _mismatch(path, f"field {last_n} differs")


def _check_points(path: Path, connection: sqlite3.Connection, rows: Sequence[Row], newest: Points) -> None:
    (run, first_n), (_, last_n) = rows[0][:2], rows[-1][:2]
    found = connection.execute(_POINTS, (run, first_n, last_n)).fetchall()
    _compare(path, "the points of field", rows, found, key=1)
    back = decode_points(found[-1][3], found[-1][2])
    if not np.array_equal(back.xyz_mm, newest.xyz_mm, equal_nan=True):
        raise _mismatch(path, f"the points of field {last_n} differ")


def _compare(path: Path, what: str, written: Sequence[Row], found: Iterable[Row], key: int) -> None:
    by_n = {row[key]: row for row in found}
    for row in written:
        if by_n.get(row[key]) != row:
            raise _mismatch(path, f"{what} {row[key]} {'differs' if key == 0 else 'differ'}")


@contextmanager
def _mismatches(path: Path) -> Iterator[None]:
    """Turns what a reader cannot make sense of into an error of the writer's."""
    try:
        yield
    except CaptureFileError as error:
        raise _mismatch(path, error.message) from error


def _mismatch(path: Path, what: str) -> StorageError:
    return StorageError(f"{path.name} does not read back as it was written: {what}", _HINT)
