"""Reading a capture file, also while it is being written."""

import os
import sqlite3
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, closing, suppress
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.checked_rows import END
from grabberd.archive.capture.content import Content, PointArrays, RowContent
from grabberd.archive.capture.digests import CHANGED, Damage, changed_parts
from grabberd.archive.capture.group_content import GroupContent
from grabberd.archive.capture.meta import (
    LARGEST_TIME_NS,
    SEALED,
    CaptureMeta,
    coverage_key,
    read_coverage,
    read_meta,
)
from grabberd.archive.capture.recorded_channels import RecordedChannels
from grabberd.archive.capture.rows import RecordedField, RunInfo, ledger, rebases_in, run_info
from grabberd.archive.capture.schema import DAMAGE, FORMAT_1, connect, format_of, named_now, reading_errors
from grabberd.archive.guarded_database import check_kind
from grabberd.core.field import NumberedField
from grabberd.core.ledger import Ledger, Outcome
from grabberd.core.reconstruction.points import Points
from grabberd.errors import CaptureFileError, NotFound
from grabberd.files.patience import check_patience


def content_of(path: Path, connection: sqlite3.Connection, left_out: list[Damage] | None = None) -> Content:
    """The fields and points of a file, by its format."""
    return (RowContent if format_of(connection) == FORMAT_1 else GroupContent)(path, connection, left_out)


class CaptureReader:
    """A capture file; each method reads its present state, and holds no lock afterwards.

    Args:
        path: The file.
        left_out: Collects damaged fields, points and readings, which `fields`, `received`, `points`,
            `timed_points` and `channels` then skip; None: damage is an error.

    Attributes:
        path: The file.
        meta: Its metadata when it was opened.
        content: Its fields and points, by its format.
        channels: Quantities measured beside the picture.

    Raises:
        CaptureFileError: From any method: missing, not a capture, damaged, or of a later version.
        ReadingGivenUp: From any method: the reading was cancelled.
    """

    def __init__(self, path: Path | str, left_out: list[Damage] | None = None) -> None:
        self.path, self._connection = _opened(Path(path))
        with reading_errors(self.path):
            self.meta = self._read_meta()
        self.content = content_of(self.path, self._connection, left_out)
        self.channels = RecordedChannels(self.path, self._connection, left_out)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file."""
        self._connection.close()

    def check_unchanged(self, runs: Collection[int] | None = None) -> None:
        """Checks metadata, ledger and runs of a sealed capture against their digests.

        Args:
            runs: The runs to check; None: all.

        Raises:
            CaptureFileError: A digest differs.
        """
        if self.meta.state != SEALED:
            return
        with reading_errors(self.path):
            changed = changed_parts(self._connection, runs)
        if changed:
            hint = "use a copy of the file; grabberd storage verify shows what else is damaged"
            raise CaptureFileError(f"{self.path}: {', '.join(changed)}: {CHANGED}", hint)

    @property
    def ledger(self) -> Ledger:
        """The ledger, from the fields in the file and the entries for all others."""
        kept = "SELECT n, outcome, reason FROM fields ORDER BY n"
        with reading_errors(self.path):
            fields = self._connection.execute(kept).fetchall()
            entries = self._connection.execute("SELECT * FROM ledger ORDER BY first_n").fetchall()
        check_patience(self.path.name)  # a day has four million fields
        try:
            return ledger(fields, entries, rebases_in(read_meta(self._connection).extra))
        except DAMAGE as error:
            message = f"{self.path}: its ledger contradicts itself: {error}"
            raise CaptureFileError(message, "set the file aside") from error

    def missing_fields(self, measured: int) -> int:
        """Number of expected fields less those `measured`."""
        return max(sum(self.ledger.counts().values()) - measured, 0)

    @property
    def field_count(self) -> int:
        """Number of fields in the file, damaged ones included."""
        return self._number("SELECT count(*) FROM fields") or 0

    @property
    def field_span(self) -> int:
        """Number of fields from the first to the last in the file; fast for a file of any length."""
        # Two subqueries: SQLite takes max(n) or min(n) from the end of the table's tree only if it is alone;
        # both in one query would read every row.
        return self._number("SELECT (SELECT max(n) FROM fields) - (SELECT min(n) FROM fields) + 1") or 0

    @property
    def length(self) -> int:
        """Number of expected fields, without reading every row."""
        lost = "SELECT %s FROM ledger"
        firsts = (self.first_n, self._number(lost % "min(first_n)"))
        ends = (self.last_field and self.last_field[0] + 1, self._number(lost % "max(first_n + count)"))
        known = [end for end in ends if end is not None]
        return max(known) - min(first for first in firsts if first is not None) if known else 0

    @property
    def losses(self) -> int:
        """Number of expected fields that were not received undamaged."""
        return self._number("SELECT sum(count) FROM ledger") or 0

    @property
    def run_count(self) -> int:
        """Number of runs."""
        return self._number("SELECT count(*) FROM runs") or 0

    @property
    def calibration_id(self) -> str:
        """Id of the calibration of the newest run; empty if there is none."""
        query = """SELECT iif(json_valid(calibration), json_extract(calibration, '$.id'), NULL) FROM runs
            ORDER BY run DESC LIMIT 1"""
        with reading_errors(self.path):
            row = self._connection.execute(query).fetchone()
        return row[0] if row and isinstance(row[0], str) and row[0].isprintable() else ""

    @property
    def runs(self) -> list[RunInfo]:
        """All runs in order."""
        with reading_errors(self.path):
            rows = self._connection.execute("SELECT * FROM runs ORDER BY run").fetchall()
            coverage = read_coverage(self._connection)
            return [run_info(row, coverage.get(coverage_key(row[0]))) for row in rows]

    def fields(self, first_n: int = 0, end_n: int | None = None) -> Iterator[RecordedField]:
        """The fields with first_n ≤ n < end_n in order, about fifty at a time."""
        return self.content.fields(first_n, END if end_n is None else end_n)

    def received(
        self, first_n: int = 0, end_n: int | None = None, *, and_damaged: bool = False
    ) -> Iterator[NumberedField]:
        """The fields received undamaged, and damaged ones if `and_damaged`; never those without a signal."""
        wanted = {Outcome.RECEIVED, Outcome.DAMAGED} if and_damaged else {Outcome.RECEIVED}
        for recorded in self.fields(first_n, end_n):
            if recorded.outcome in wanted:
                yield recorded.numbered

    def field(self, n: int) -> RecordedField:
        """One field.

        Raises:
            NotFound: It is not in the file.
        """
        for recorded in self.fields(n, n + 1):
            return recorded
        raise NotFound(f"capture {self.meta.id} has no field {n}", "its ledger says what became of it")

    def run(self, run: int | None) -> RunInfo:
        """A run by number, or the newest.

        Raises:
            NotFound: It does not exist, or the capture has not been measured.
        """
        number = self.run_number(run)
        return next(info for info in self.runs if info.run == number)

    def run_number(self, run: int | None) -> int:
        """Number of a run, or of the newest, without reading its calibration.

        Raises:
            NotFound: It does not exist, or the capture has not been measured.
        """
        with reading_errors(self.path):
            rows = self._connection.execute("SELECT run FROM runs ORDER BY run").fetchall()
        runs = [number for (number,) in rows if isinstance(number, int)]
        if run is None and not runs:
            raise NotFound(f"capture {self.meta.id} has no points", "measure it with a calibration first")
        if run is not None and run not in runs:
            known = ", ".join(map(str, runs)) or "none"
            raise NotFound(f"capture {self.meta.id} has no run {run}", f"its runs are: {known}")
        return runs[-1] if run is None else run

    def points(self, run: int | None = None) -> Iterator[tuple[int, Points]]:
        """(n, points) of a run in order of n, for fields in the file.

        Raises:
            NotFound: The run does not exist.
        """
        for n, _, points in self.timed_points(run):
            yield n, points

    def timed_points(
        self, run: int | None = None, first_n: int = 0, end_n: int = END, every: int = 1
    ) -> Iterator[tuple[int, int, Points]]:
        """(n, time_ns, points) of a run in order of n, about fifty fields at a time.

        Only fields with first_n ≤ n < end_n whose n is a multiple of `every`. Points that a crash left
        without their field are skipped.

        Raises:
            NotFound: The run does not exist.
        """
        for arrays in self.point_arrays(run, first_n, end_n, every):
            yield from arrays.by_field()

    def point_arrays(
        self, run: int | None = None, first_n: int = 0, end_n: int = END, every: int = 1
    ) -> Iterator[PointArrays]:
        """The same, with several fields together as stored in the file.

        Raises:
            NotFound: The run does not exist.
        """
        yield from self.content.points(self.run_number(run), first_n, end_n, every)

    def check_points(self, run: int, first_n: int = 0, end_n: int = END) -> None:
        """Checks points of a run against their digests, without decoding them.

        Raises:
            CaptureFileError: A digest differs.
        """
        if self.content.has_digests:
            self.content.check_points(run, first_n, end_n)

    def point_count(self, run: int, first_n: int = 0, end_n: int = END, every: int = 1) -> int:
        """Number of points that `timed_points` yields."""
        return self.content.point_count(run, first_n, end_n, every)

    def point_span(self, run: int, first_n: int = 0, end_n: int = END) -> tuple[int, int]:
        """Number of points that `timed_points` yields now, and the number after the last field with points.

        A capture that is being written gets no more points below that number.
        """
        return self.content.point_span(run, first_n, end_n)

    def field_times(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers and times of the fields in the file, in order, except those without a valid time."""
        query = (
            "SELECT n, time_ns FROM fields"
            " WHERE typeof(time_ns) = 'integer' AND time_ns BETWEEN 0 AND ? ORDER BY n"
        )
        with reading_errors(self.path):
            rows = self._connection.execute(query, (LARGEST_TIME_NS,)).fetchall()
            check_patience(self.path.name)
            n, time_ns = np.array(rows, np.int64).reshape(-1, 2).T
        return n, time_ns

    @property
    def first_n(self) -> int | None:
        """Number of the first field; None in an empty capture."""
        return self._number("SELECT n FROM fields ORDER BY n LIMIT 1")

    @property
    def first_time_ns(self) -> int | None:
        """Time of the first field; None in an empty capture."""
        return self._number("SELECT time_ns FROM fields ORDER BY n LIMIT 1")

    @property
    def last_field(self) -> tuple[int, int] | None:
        """Number and time of the last field; None in an empty capture."""
        with reading_errors(self.path):
            row = self._connection.execute("SELECT n, time_ns FROM fields ORDER BY n DESC LIMIT 1").fetchone()
            return None if row is None else (int(row[0]), int(row[1]))

    def _read_meta(self) -> CaptureMeta:
        try:
            return read_meta(self._connection)
        except DAMAGE as error:
            self._connection.close()
            hint = "it was cut off within its first second; nothing is in it"
            raise CaptureFileError(f"{self.path} has no valid metadata: {error}", hint) from error

    def _number(self, query: str, *values: int) -> int | None:
        """The integer that a query selects; None if it selects nothing."""
        with reading_errors(self.path):
            row = self._connection.execute(query, values).fetchone()
            found = row and row[0]
            if not isinstance(found, int | None):
                raise ValueError(f"{found!r} is not a whole number")
            return found


Opened = Callable[[Path], AbstractContextManager[CaptureReader]]
"""Opens a capture for the duration of a block."""


def stat_at_rest(path: Path) -> os.stat_result:
    """Size and time of a file between two commits; data read while they are unchanged are consistent.

    A file that cannot be read as a capture has no writer, so its size and time are returned as they are.

    Raises:
        CaptureFileError: The path is not a regular file but, e.g., a link to some other file.
        StorageError: The file has been locked by a writer for more than ten seconds.
    """
    path = named_now(path)
    with reading_errors(path):
        check_kind(path)
    with suppress(CaptureFileError), closing(connect(path)) as connection, reading_errors(path):
        connection.execute("BEGIN")
        # BEGIN alone takes no lock; after the first read, nobody can commit until the connection is closed.
        connection.execute("SELECT count(*) FROM meta").fetchone()
        return path.stat()
    return path.stat()


def _opened(path: Path) -> tuple[Path, sqlite3.Connection]:
    """Opens a capture, under its final name if it was sealed after its path was looked up."""
    try:
        return path, connect(path)
    except CaptureFileError:
        sealed = named_now(path)
        if sealed == path:
            raise
        return sealed, connect(sealed)
