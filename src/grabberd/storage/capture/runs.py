"""Adding a run to a sealed capture."""

import fcntl
import sqlite3
import struct
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import IO, Any

from grabberd.errors import StorageError
from grabberd.reconstruction.points import Points
from grabberd.storage.capture.codec import encode_points
from grabberd.storage.capture.digests import (
    forget_points_after,
    points_prefix,
    row_digest,
    write_row_digests,
    write_run_digest,
)
from grabberd.storage.capture.meta import coverage_key, write_meta
from grabberd.storage.capture.read_back import check_staged
from grabberd.storage.capture.schema import connect, reading_errors
from grabberd.storage.capture.writer import DONE, INSERT_POINTS, INSERT_RUN, run_row
from grabberd.storage.disk import storage_errors

_HEAD = struct.Struct("<qII")
"""Head of one field's points in the temporary file: number of the field, points, bytes."""
CACHE_KIB = 64 * 1024
"""SQLite's page cache: while a transaction fits into it, its pages reach the file only with the commit."""
FIELDS_A_COMMIT = 500
"""Few enough for the cache: a transaction that outgrows it locks readers out until it ends."""
PAUSE_S = 0.02
"""Pause between two commits, in which waiting readers get the lock."""
_REMOVE = """DELETE FROM points WHERE (run, n) IN
    (SELECT run, n FROM points WHERE run > (SELECT coalesce(max(run), 0) FROM runs) LIMIT ?)"""


def append_run(
    path: Path,
    kind: str,
    created_utc: str,
    version: str,
    made_with: Mapping[str, Any],
    points: Iterable[tuple[int, Points]],
    coverage: Callable[[], Mapping[str, Any]] | None = None,
) -> int:
    """Adds a run to a sealed capture, whole or not at all; returns its number.

    `points` may be a generator that measures them: they first go into an unnamed temporary file beside the
    capture, which disappears with this call or with the program, and then into the capture batch by batch, so
    that few of them are in memory and readers never wait for long. The run itself is entered last. Until then
    its points belong to no run, and the next call removes what a killed program left of them. `coverage`, how
    well it was measured, is asked for when all points have been taken, and entered with the run.

    Raises:
        CaptureFileError: The file is no capture, or damaged.
        StorageError: It cannot be written, does not read back as it was written, or another program is
            adding a run to it.
    """
    # Staged before the lock is taken: measuring may take minutes, copying what was measured seconds.
    with (
        closing(connect(path, writable=True)) as connection,
        _staged(path, points) as staged,
        reading_errors(path),  # damage beyond what was read so far
        storage_errors(path),
        _alone(path),
    ):
        connection.execute(f"PRAGMA cache_size = -{CACHE_KIB:d}")
        _remove_unfinished(connection)
        run: int = connection.execute("SELECT coalesce(max(run), 0) + 1 FROM runs").fetchone()[0]
        try:
            _copy(staged, connection, run)
            staged.seek(0)
            check_staged(path, connection, run, _rows(staged))
            with _transaction(connection):
                connection.execute(INSERT_RUN, run_row(run, kind, created_utc, version, DONE, made_with))
                if coverage is not None:
                    write_meta(connection, {coverage_key(run): coverage()})
                write_run_digest(connection, run)
        except BaseException:
            with suppress(sqlite3.Error):
                _remove_unfinished(connection)
            raise
        return run


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Prevents other programs from adding a run while the block lasts."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            hint = "wait until it has finished, then try again"
            raise StorageError(f"another program is adding a run to {path.name}", hint) from None
        yield


def _copy(staged: IO[bytes], connection: sqlite3.Connection, run: int) -> None:
    digests: dict[int, str] = {}

    def rows() -> Iterator[tuple[Any, ...]]:
        for stored in _rows(staged):
            row = (run, *stored)
            digests[row[1]] = row_digest(row)
            yield row

    remaining, copied = rows(), FIELDS_A_COMMIT
    while copied == FIELDS_A_COMMIT:
        with _transaction(connection):
            copied = connection.executemany(INSERT_POINTS, islice(remaining, FIELDS_A_COMMIT)).rowcount
            write_row_digests(connection, points_prefix(run), digests)
        digests.clear()
        time.sleep(PAUSE_S)


def _remove_unfinished(connection: sqlite3.Connection) -> None:
    """Removes points whose run was never entered, batch by batch."""
    removed = 1
    while removed:
        with _transaction(connection):
            removed = connection.execute(_REMOVE, (FIELDS_A_COMMIT,)).rowcount
    with _transaction(connection):
        newest: int = connection.execute("SELECT coalesce(max(run), 0) FROM runs").fetchone()[0]
        forget_points_after(connection, newest)


@contextmanager
def _transaction(connection: sqlite3.Connection) -> Iterator[None]:
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        yield


def _staged(path: Path, points: Iterable[tuple[int, Points]]) -> IO[bytes]:
    """A temporary file with all points, positioned at its beginning."""
    with storage_errors(path):
        file = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115 - the caller closes it
    try:
        for n, field_points in points:
            data = encode_points(field_points)
            with storage_errors(path):
                file.write(_HEAD.pack(n, len(field_points), len(data)) + data)
        with storage_errors(path):
            file.seek(0)
    except BaseException:
        file.close()
        raise
    return file


def _rows(file: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
    while head := file.read(_HEAD.size):
        n, count, size = _HEAD.unpack(head)
        yield n, count, file.read(size)
