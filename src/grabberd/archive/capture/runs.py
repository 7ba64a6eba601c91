"""Adding a run to a sealed capture."""

import json
import os
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import IO, Any

from grabberd import runtime
from grabberd.archive.capture.digests import (
    Row,
    forget_points_after,
    points_prefix,
    row_digest,
    write_row_digests,
    write_run_digest,
)
from grabberd.archive.capture.groups import PointTable, point_table
from grabberd.archive.capture.meta import MOST_RUNS, coverage_key, write_meta
from grabberd.archive.capture.schema import connect, format_of, reading_errors
from grabberd.archive.capture.verification import check_staged
from grabberd.archive.capture.writer import DONE, INSERT_RUN, run_row
from grabberd.core.reconstruction.points import Points
from grabberd.errors import StorageError
from grabberd.files.disk import flocked, storage_errors

_SIZE = struct.Struct("<I")
"""In the temporary file, the length of a row's cells as JSON; these include the sizes of its blobs."""
CACHE_KIB = 64 * 1024
"""Size of SQLite's page cache: a transaction that fits writes its pages only with the commit."""
PAUSE_S = 0.02
"""Pause between two commits, in which waiting readers can get the lock."""
_UNKNOWN = 0
"""Number of a run while its points are staged."""
_REMOVE = """DELETE FROM points WHERE (run, {key}) IN
    (SELECT run, {key} FROM points WHERE run > (SELECT coalesce(max(run), 0) FROM runs) LIMIT ?)"""


def append_run(
    path: Path,
    kind: str,
    created_utc: str,
    version: str,
    made_with: Mapping[str, Any],
    points: Iterable[tuple[int, Points]],
    coverage: Callable[[], Mapping[str, Any]] | None = None,
) -> int:
    """Adds a run to a sealed capture, completely or not at all; returns its number.

    `points` may be a generator that measures them: they are first written to an unnamed temporary file beside
    the capture, which disappears with this call or the process, and then copied in batches, so that few of
    them are in memory and readers never wait for long. The run itself is added last. Until then its points
    belong to no run; if the program is killed, the next call removes them. `coverage`, which states how well
    the run was measured, is called after all points have been read, and stored with the run.

    Raises:
        CaptureFileError: The file is not a capture, or damaged.
        StorageError: The file cannot be written, differs when read back, or another program is adding a run.
    """
    # Staged before the lock is taken: measuring may take minutes, copying what was measured seconds.
    with reading_errors(path):
        inode = path.stat().st_ino
    with (
        closing(connect(path, writable=True)) as connection,
        _staged(path, (table := point_table(format_of(connection))).encode(_UNKNOWN, points)) as staged,
        reading_errors(path),  # damage beyond what was read so far
        storage_errors(path, takes_damage=False),
        alone(path, inode),
    ):
        connection.execute(f"PRAGMA cache_size = -{CACHE_KIB:d}")
        _remove_unfinished(connection, table)
        _check_room(path, connection)
        run: int = connection.execute("SELECT coalesce(max(run), 0) + 1 FROM runs").fetchone()[0]
        try:
            _copy(staged, connection, table, run)
            staged.seek(0)
            check_staged(path, connection, table, _rows(staged, run))
            with _transaction(connection):
                connection.execute(INSERT_RUN, run_row(run, kind, created_utc, version, DONE, made_with))
                if coverage is not None:
                    write_meta(connection, {coverage_key(run): coverage()})
                write_run_digest(connection, run)
        except BaseException:
            with suppress(sqlite3.Error):
                _remove_unfinished(connection, table)
            raise
        return run


def _check_room(path: Path, connection: sqlite3.Connection) -> None:
    if connection.execute("SELECT count(*) FROM runs").fetchone()[0] >= MOST_RUNS:
        hint = "measure a copy of it that has no runs, or export what the newest run has"
        raise StorageError(f"{path.name} has {MOST_RUNS} runs, and can have no more", hint)


@contextmanager
def alone(path: Path, inode: int) -> Iterator[None]:
    """Prevents other programs from adding a run or converting the file while the block lasts.

    Args:
        path: The file.
        inode: Its inode number when it was opened.

    Raises:
        StorageError: Another program is doing so, or has replaced the file.
    """
    with ExitStack() as stack:
        try:
            descriptor = stack.enter_context(flocked(path))
        except BlockingIOError:
            hint = "wait until it has finished, then try again"
            raise StorageError(f"another program is adding a run to {path.name}", hint) from None
        if os.fstat(descriptor).st_ino != inode:  # changes would be lost with the old file
            raise StorageError(f"{path.name} was replaced meanwhile, by its conversion perhaps", "try again")
        yield


def _copy(staged: IO[bytes], connection: sqlite3.Connection, table: PointTable, run: int) -> None:
    digests: dict[int, str] = {}

    def rows() -> Iterator[Row]:
        for row in _rows(staged, run):
            digests[row[1]] = row_digest(table.digested(row))
            yield row

    remaining, copied = rows(), table.rows_a_commit
    while copied == table.rows_a_commit:
        with _transaction(connection):
            copied = connection.executemany(table.insert, islice(remaining, table.rows_a_commit)).rowcount
            write_row_digests(connection, points_prefix(run), digests)
        digests.clear()
        runtime.sleep(PAUSE_S)


def _remove_unfinished(connection: sqlite3.Connection, table: PointTable) -> None:
    """Removes points whose run was never completed, in batches."""
    removed = 1
    while removed:
        with _transaction(connection):
            removed = connection.execute(_REMOVE.format(key=table.key), (table.rows_a_commit,)).rowcount
    with _transaction(connection):
        newest: int = connection.execute("SELECT coalesce(max(run), 0) FROM runs").fetchone()[0]
        forget_points_after(connection, newest)


@contextmanager
def _transaction(connection: sqlite3.Connection) -> Iterator[None]:
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        yield


def _staged(path: Path, rows: Iterable[Row]) -> IO[bytes]:
    """A temporary file with all rows, positioned at its start."""
    with storage_errors(path):
        file = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115 - the caller closes it
    try:
        for _, *cells in rows:
            blobs = [cell for cell in cells if isinstance(cell, bytes)]
            head = json.dumps([[len(cell)] if isinstance(cell, bytes) else cell for cell in cells]).encode()
            with storage_errors(path):
                file.write(b"".join((_SIZE.pack(len(head)), head, *blobs)))
        with storage_errors(path):
            file.seek(0)
    except BaseException:
        file.close()
        raise
    return file


def _rows(file: IO[bytes], run: int) -> Iterator[Row]:
    """The rows of a temporary file, as rows of a run."""
    while size := file.read(_SIZE.size):
        cells = json.loads(file.read(*_SIZE.unpack(size)))
        yield (run, *(file.read(*cell) if isinstance(cell, list) else cell for cell in cells))
