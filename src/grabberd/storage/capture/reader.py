"""Reading a capture file, also while it is being written."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Self

from grabberd.acquisition import Ledger, Outcome
from grabberd.errors import CaptureFileError, NotFound
from grabberd.field import NumberedField
from grabberd.reconstruction.points import Points
from grabberd.storage.capture.codec import decode_points
from grabberd.storage.capture.meta import LARGEST_TIME_NS, CaptureMeta, coverage_key, read_coverage, read_meta
from grabberd.storage.capture.rebases import rebases_in
from grabberd.storage.capture.rows import (
    FIELD_COLUMNS,
    RecordedField,
    RunInfo,
    ledger,
    recorded_field,
    run_info,
)
from grabberd.storage.capture.schema import DAMAGE, connect, reading_errors
from grabberd.storage.guarded_database import check_kind

FIELDS_AT_ONCE = 50
"""Fields read under one lock: a reader in the middle of a statement keeps the writer from committing, which
it does twice a second."""
BYTES_AT_ONCE = 32 << 20
"""Size of the pictures after which no further one is read under the same lock."""
END = 2**62
"""A number beyond every field's."""


class CaptureReader:
    """A capture file; each method sees its state at that moment, and holds no lock afterwards.

    Raises:
        CaptureFileError: From any method: missing, no capture, damaged, or of a later version.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._connection = connect(self.path)
        with reading_errors(self.path):
            self.meta = self._read_meta()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file."""
        self._connection.close()

    @property
    def ledger(self) -> Ledger:
        """The ledger, made of the fields in the file and the entries for all others."""
        kept = "SELECT n, outcome, reason FROM fields ORDER BY n"
        with reading_errors(self.path):
            fields = self._connection.execute(kept).fetchall()
            entries = self._connection.execute("SELECT * FROM ledger ORDER BY first_n").fetchall()
        try:
            return ledger(fields, entries, rebases_in(read_meta(self._connection).extra))
        except DAMAGE as error:
            raise self._damaged("its ledger contradicts itself", error, "set the file aside") from error

    def missing_fields(self, measured: int) -> int:
        """Number of fields that should have come, but for those `measured`."""
        return max(sum(self.ledger.counts().values()) - measured, 0)

    @property
    def field_count(self) -> int:
        """Number of fields in the file, damaged ones included."""
        return self._number("SELECT count(*) FROM fields") or 0

    @property
    def field_span(self) -> int:
        """Number of fields from the first to the last in the file, known at once however long it is."""
        # Two subqueries: SQLite takes max(n) or min(n) from the end of the table's tree only where it stands
        # alone; both in one query would read every row.
        return self._number("SELECT (SELECT max(n) FROM fields) - (SELECT min(n) FROM fields) + 1") or 0

    @property
    def runs(self) -> list[RunInfo]:
        """All runs in order."""
        with reading_errors(self.path):
            rows = self._connection.execute("SELECT * FROM runs ORDER BY run").fetchall()
            coverage = read_coverage(self._connection)
            return [run_info(row, coverage.get(coverage_key(row[0]))) for row in rows]

    def fields(self, first_n: int = 0, end_n: int | None = None) -> Iterator[RecordedField]:
        """The fields with first_n ≤ n < end_n in order, fifty at a time."""
        while True:
            rows = self._rows(first_n, end_n)
            for row in rows:
                yield self._field(row)
            if not rows:
                return
            first_n = rows[-1][0] + 1

    def received(
        self, first_n: int = 0, end_n: int | None = None, *, and_damaged: bool = False
    ) -> Iterator[NumberedField]:
        """The fields that were received undamaged, or `and_damaged`; never those without a signal."""
        wanted = {Outcome.RECEIVED, Outcome.DAMAGED} if and_damaged else {Outcome.RECEIVED}
        for recorded in self.fields(first_n, end_n):
            if recorded.outcome in wanted:
                yield recorded.numbered

    def field(self, n: int) -> RecordedField:
        """One field.

        Raises:
            NotFound: It is not in the file.
        """
        rows = self._rows(n, n + 1)
        if not rows:
            raise NotFound(f"capture {self.meta.id} has no field {n}", "its ledger says what became of it")
        return self._field(rows[0])

    def run(self, run: int | None) -> RunInfo:
        """A run by number, or the newest.

        Raises:
            NotFound: It does not exist, or the capture has not been measured.
        """
        runs = self.runs
        if run is None and not runs:
            raise NotFound(f"capture {self.meta.id} has no points", "measure it with a calibration first")
        found = [info for info in runs if run in (None, info.run)]
        if not found:
            known = ", ".join(str(info.run) for info in runs) or "none"
            raise NotFound(f"capture {self.meta.id} has no run {run}", f"its runs are: {known}")
        return found[-1]

    def points(self, run: int | None = None) -> Iterator[tuple[int, Points]]:
        """(n, points) of a run in order of n, of fields that are in the file.

        Raises:
            NotFound: The run does not exist.
        """
        for n, _, points in self.timed_points(run):
            yield n, points

    def timed_points(
        self, run: int | None = None, first_n: int = 0, end_n: int = END, every: int = 1
    ) -> Iterator[tuple[int, int, Points]]:
        """(n, time_ns, points) of a run in order of n, fifty fields at a time.

        Only fields with first_n ≤ n < end_n whose n is a multiple of `every`. Points that a crash left
        without their field are skipped.

        Raises:
            NotFound: The run does not exist.
        """
        number, first_n = self.run(run).run, first_n - 1
        query = (
            "SELECT p.n, f.time_ns, p.data FROM points AS p JOIN fields AS f ON f.n = p.n "
            "WHERE p.run = ? AND p.n > ? AND p.n < ? AND p.n % ? = 0 ORDER BY p.n LIMIT ?"
        )
        while True:
            with reading_errors(self.path):
                asked = (number, first_n, end_n, every, FIELDS_AT_ONCE)
                rows = some_rows(self._connection.execute(query, asked))
            for n, time_ns, data in rows:
                if not isinstance(time_ns, int) or not 0 <= time_ns < LARGEST_TIME_NS:
                    raise self._damaged(f"field {n}", ValueError(f"time_ns is {time_ns!r}"))
                yield n, time_ns, self._points(n, data)
            if not rows:
                return
            first_n = rows[-1][0]

    def point_count(self, run: int, first_n: int = 0, end_n: int = END, every: int = 1) -> int:
        """Number of points that `timed_points` would give."""
        query = "SELECT coalesce(sum(count), 0) FROM points WHERE run = ? AND n >= ? AND n < ? AND n % ? = 0"
        return self._number(query, run, first_n, end_n, every) or 0

    def point_span(self, run: int, first_n: int = 0, end_n: int = END) -> tuple[int, int]:
        """Number of points that `timed_points` gives now, and the number after the last field that has some.

        A capture that is being written gets no more points below that number.
        """
        query = (
            "SELECT coalesce(sum(p.count), 0), coalesce(max(p.n) + 1, 0) FROM points AS p "
            "JOIN fields AS f ON f.n = p.n WHERE p.run = ? AND p.n >= ? AND p.n < ?"
        )
        with reading_errors(self.path):
            count, end = self._connection.execute(query, (run, first_n, end_n)).fetchone()
            return int(count), int(end)

    @property
    def first_time_ns(self) -> int | None:
        """Time of the first field; None if there is none."""
        return self._number("SELECT time_ns FROM fields ORDER BY n LIMIT 1")

    @property
    def last_field(self) -> tuple[int, int] | None:
        """Number and time of the last field; None if there is none."""
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
        """The first cell of a query's first row; None if there is none."""
        with reading_errors(self.path):
            row = self._connection.execute(query, values).fetchone()
            return None if row is None or row[0] is None else int(row[0])

    def _rows(self, first_n: int, end_n: int | None) -> list[tuple[Any, ...]]:
        query = f"SELECT {FIELD_COLUMNS} FROM fields WHERE n >= ? AND n < ? ORDER BY n LIMIT ?"  # noqa: S608 - constants
        values = (first_n, END if end_n is None else end_n, FIELDS_AT_ONCE)
        with reading_errors(self.path):
            return some_rows(self._connection.execute(query, values))

    def _field(self, row: tuple[Any, ...]) -> RecordedField:
        try:
            return recorded_field(row)
        except DAMAGE as error:
            raise self._damaged(f"field {row[0]}", error) from error

    def _points(self, n: int, data: bytes) -> Points:
        try:
            return decode_points(data)
        except DAMAGE as error:
            raise self._damaged(f"points of field {n}", error, "re-measure the capture") from error

    def _damaged(
        self, what: str, error: Exception, hint: str = "the other fields can be read"
    ) -> CaptureFileError:
        return CaptureFileError(f"{self.path}: {what}: {error}", hint)


def some_rows(cursor: sqlite3.Cursor) -> list[tuple[Any, ...]]:
    """The first rows of a query, as many as hold `BYTES_AT_ONCE` together and one more at most."""
    taken: list[tuple[Any, ...]] = []
    size = 0
    with closing(cursor):  # its lock, too, ends here
        for row in cursor:
            taken.append(row)
            size += sum(len(cell) for cell in row if isinstance(cell, bytes))
            if size > BYTES_AT_ONCE:
                break
    return taken


def stat_at_rest(path: Path) -> os.stat_result:
    """Size and time of a file between two commits; what is read while they stay the same belongs together.

    A file that cannot be read as a capture has no writer: its size and time are taken as they are.

    Raises:
        CaptureFileError: It is a link or the like, which could lead to any other file.
        StorageError: Somebody writes it for longer than ten seconds.
    """
    with reading_errors(path):
        check_kind(path)
    with suppress(CaptureFileError), closing(connect(path)) as connection, reading_errors(path):
        connection.execute("BEGIN")
        # BEGIN alone takes no lock; after the first read nobody commits until the connection is closed.
        connection.execute("SELECT count(*) FROM meta").fetchone()
        return path.stat()
    return path.stat()
