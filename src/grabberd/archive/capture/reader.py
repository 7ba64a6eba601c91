"""Reading a capture file, also while it is being written."""

import os
import sqlite3
from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, closing, suppress
from itertools import chain
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.content import Content, GroupContent, PointArrays, RowContent
from grabberd.archive.capture.digests import CHANGED, END, Damage, changed_parts
from grabberd.archive.capture.meta import (
    LARGEST_N,
    LARGEST_TIME_NS,
    LONGEST_NAME,
    LONGEST_REASON,
    LONGEST_SAID,
    MOST_RUNS,
    SEALED,
    CaptureMeta,
    RecordedMarks,
    read_coverage,
    read_meta,
)
from grabberd.archive.capture.recorded_channels import RecordedChannels
from grabberd.archive.capture.recorded_ledger import Line, RecordedLedger, rebases_in
from grabberd.archive.capture.rows import LARGEST_RUN, RecordedField, RunInfo, run_info
from grabberd.archive.capture.schema import DAMAGE, FORMAT_1, connect, format_of, named_now, reading_errors
from grabberd.archive.guarded_database import check_kind
from grabberd.core.field import NumberedField
from grabberd.core.ledger import Ledger, LedgerEvent, Outcome
from grabberd.core.measurement.marks import Located
from grabberd.core.reconstruction.points import Points
from grabberd.errors import CaptureFileError, NotFound

_SHORT_RUN = f"""SELECT run, kind, created_utc, version, state,
    CASE WHEN length(reason) <= {LONGEST_REASON} THEN reason END"""
_RUN_ALONE = f"{_SHORT_RUN}, 'null', 'null', 'null' FROM runs WHERE run = ?"
_RUN = f"{_SHORT_RUN}, calibration, object, settings FROM runs WHERE run = ?"
_INVALID_TIME = """SELECT n, time_ns FROM fields
    WHERE typeof(time_ns) <> 'integer' OR time_ns NOT BETWEEN 0 AND ? LIMIT 1"""
_RUN_NUMBERS = "SELECT run FROM runs ORDER BY run LIMIT ?"


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
        return RecordedLedger(self.path, self._connection).read(self._events())

    def short_ledger(self, most: int) -> Ledger:
        """The ledger with so many of its entries, in little time and memory."""
        recorded = RecordedLedger(self.path, self._connection)
        return recorded.short(self._events(), most, sealed=self.meta.state == SEALED)

    def ledger_lines(self, first_n: int, passed: int, most: int) -> list[Line]:
        """Entries and events of the ledger from a field on; see `RecordedLedger.lines`."""
        return RecordedLedger(self.path, self._connection).lines(self._events(), first_n, passed, most)

    def _events(self) -> list[LedgerEvent]:
        with reading_errors(self.path):
            return rebases_in(read_meta(self._connection).extra)

    def missing_fields(self, measured: int) -> int:
        """Number of expected fields less those `measured`."""
        return max(self.short_ledger(0).total - measured, 0)

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
        firsts = (self.first_n, self._number("SELECT min(first_n) FROM ledger"))
        return self.end_n - min((first for first in firsts if first is not None), default=0)

    @property
    def end_n(self) -> int:
        """The number after the last expected field, without reading every row; 0 in an empty capture."""
        of_ledger = self._number("SELECT max(first_n + count) FROM ledger")
        last_n = self._number("SELECT n FROM fields ORDER BY n DESC LIMIT 1")
        return max(0 if last_n is None else last_n + 1, of_ledger or 0)

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
        known = row[0] if row and isinstance(row[0], str) and row[0].isprintable() else ""
        return known if len(known) <= LONGEST_NAME else ""

    @property
    def runs(self) -> list[RunInfo]:
        """All runs in order."""
        return [self.run(number) for number in self.run_numbers]

    @property
    def run_numbers(self) -> list[int]:
        """Numbers of all runs in order."""
        with reading_errors(self.path):
            rows = self._connection.execute(_RUN_NUMBERS, (MOST_RUNS + 1,)).fetchall()
            if len(rows) > MOST_RUNS:
                raise ValueError(f"it has more than {MOST_RUNS} runs")
            numbers = [number for (number,) in rows]
            if not all(number in range(1, LARGEST_RUN) for number in numbers[:1] + numbers[-1:]):
                raise ValueError(f"a run has the number {numbers[0]} or {numbers[-1]}")
        return numbers

    def newest_runs(self, most: int) -> Iterator[RunInfo]:
        """The newest runs in order, each without the documents that its points were measured with."""
        return (self._run(number, _RUN_ALONE) for number in self.run_numbers[-most:])

    def fields(self, first_n: int = 0, end_n: int | None = None) -> Iterator[RecordedField]:
        """The fields with first_n ≤ n < end_n in order, about fifty at a time."""
        fields = self.content.fields(first_n, END if end_n is None else end_n)
        return self._with_marks(fields) if self.meta.config.get("marks") else fields

    def marks_before(self) -> list[tuple[int, Located]]:
        """Parity and located marks of the fields before the first, in order; empty if none are known."""
        return RecordedMarks(self.path, self._connection).before

    def _with_marks(self, fields: Iterator[RecordedField]) -> Iterator[RecordedField]:
        """The same fields with the places that their marks were located at."""
        marks = RecordedMarks(self.path, self._connection)
        for one in fields:
            numbered = one.numbered
            packed = numbered.packed.with_marks(marks.of(numbered.n))
            yield one._replace(numbered=numbered._replace(packed=packed))

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
        return self._run(self.run_number(run), _RUN)

    def _run(self, number: int, query: str) -> RunInfo:
        with reading_errors(self.path):
            row = self._connection.execute(query, (number,)).fetchone()
            return run_info(row, read_coverage(self._connection, number))

    def run_number(self, run: int | None) -> int:
        """Number of a run, or of the newest, without reading its calibration.

        Raises:
            NotFound: It does not exist, or the capture has not been measured.
        """
        runs = self.run_numbers
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

    def check_numbers(self, run: int, first_n: int = 0, end_n: int = END) -> None:
        """Checks the times of all fields, and the numbers of a run's points.

        Raises:
            CaptureFileError: One is out of range, or contradicts others.
        """
        with reading_errors(self.path):
            invalid = self._connection.execute(_INVALID_TIME, (LARGEST_TIME_NS - 1,)).fetchone()
            if invalid is not None:
                found = f"{invalid[1]!r}"[:LONGEST_SAID]
                raise ValueError(f"field {invalid[0]}: time_ns is {found}, not a whole number from 0 on")
        self.point_count(run, first_n, end_n)

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
            rows = self._connection.execute(query, (LARGEST_TIME_NS,))
            n, time_ns = np.fromiter(chain.from_iterable(rows), np.int64).reshape(-1, 2).T
        return n, time_ns

    @property
    def first_n(self) -> int | None:
        """Number of the first field; None in an empty capture."""
        return self._number("SELECT n FROM fields ORDER BY n LIMIT 1")

    @property
    def first_time_ns(self) -> int | None:
        """Time of the first field; None in an empty capture."""
        return self._number("SELECT time_ns FROM fields ORDER BY n LIMIT 1", below=LARGEST_TIME_NS)

    @property
    def last_field(self) -> tuple[int, int] | None:
        """Number and time of the last field; None in an empty capture."""
        last = "SELECT {} FROM fields ORDER BY n DESC LIMIT 1"
        n = self._number(last.format("n"))
        return None if n is None else (n, self._number(last.format("time_ns"), below=LARGEST_TIME_NS) or 0)

    def _read_meta(self) -> CaptureMeta:
        try:
            return read_meta(self._connection)
        except DAMAGE as error:
            self._connection.close()
            hint = "it was cut off within its first second; nothing is in it"
            raise CaptureFileError(f"{self.path} has no valid metadata: {error}", hint) from error

    def _number(self, query: str, below: int = LARGEST_N) -> int | None:
        """The integer that a query selects, from 0 on and below a bound; None if it selects nothing."""
        with reading_errors(self.path):
            row = self._connection.execute(query).fetchone()
            found = row and row[0]
            if not isinstance(found, int | None) or (found is not None and not 0 <= found < below):
                raise ValueError(f"{found!r} is not a whole number from 0 to {below - 1}"[:LONGEST_SAID])
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
