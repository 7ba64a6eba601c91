"""Adding a run to a sealed capture."""

import struct
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from grabberd.reconstruction.points import Points
from grabberd.storage.codec import encode_points
from grabberd.storage.schema import connect, storage_errors
from grabberd.storage.writer import DONE, INSERT_POINTS, INSERT_RUN, run_row

_HEAD = struct.Struct("<qII")
"""Of one field's points on their way: number of the field, of its points, of their bytes."""
CACHE_KIB = 64 * 1024


def append_run(
    path: Path,
    kind: str,
    created_utc: str,
    version: str,
    made_with: Mapping[str, Any],
    points: Iterable[tuple[int, Points]],
) -> int:
    """Adds a run to a sealed capture, whole or not at all; returns its number.

    The points may be measured while they are taken: they go into a nameless file beside the capture, which is
    gone with this call or with the program, and then into the capture within one transaction. So memory
    holds few of them, and readers wait at the end only, as long as copying takes.

    Raises:
        CaptureFileError: no capture, or damaged.
        StorageError: it cannot be written.
    """
    connection = connect(path, writable=True)
    try:
        with _staged(path, points) as staged, storage_errors(path), connection:
            connection.execute(f"PRAGMA cache_size = -{CACHE_KIB:d}")
            connection.execute("BEGIN IMMEDIATE")
            run: int = connection.execute("SELECT coalesce(max(run), 0) + 1 FROM runs").fetchone()[0]
            connection.execute(INSERT_RUN, run_row(run, kind, created_utc, version, DONE, made_with))
            connection.executemany(INSERT_POINTS, ((run, *row) for row in _rows(staged)))
            return run
    finally:
        connection.close()


def _staged(path: Path, points: Iterable[tuple[int, Points]]) -> IO[bytes]:
    """A file at its beginning, with all the points."""
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
