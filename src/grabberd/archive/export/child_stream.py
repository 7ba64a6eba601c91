"""A capture's points as Parquet or as a MAT-file, from a process of their own.

pyarrow and scipy.io are large, slow to import and keep the interpreter to themselves while they write, so a
daemon has a niced process do it.
"""

import os
import tempfile
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from grabberd.archive.export.mat_file import check_stream_size, points_mat
from grabberd.archive.export.points_export import open_run, points_parquet
from grabberd.archive.export.table_files import check_parquet
from grabberd.errors import StorageError
from grabberd.work.child import Limits
from grabberd.work.process import NoAnswer, Process

CHUNK_BYTES = 65_536
LIMITS = Limits(niceness=10)
"""Without a limit of memory: Parquet is written in groups of rows, and a MAT-file's size is known before."""
PARQUET, MAT = "Parquet", "MAT-file"


def parquet_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """A Parquet file as it is written; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound, ExtraMissing: See `points_parquet`.
    """
    check_parquet()
    reader, number = open_run(path, run)
    reader.close()
    return _from_child(PARQUET, path, number)


def mat_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """A MAT-file, once it has been written; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound: See `points_mat`.
        InputError: It would take too much of the daemon's memory.
    """
    reader, number = open_run(path, run)
    with reader:
        check_stream_size(reader, number)
    return _from_child(MAT, path, number)


def _from_child(kind: str, path: Path, run: int) -> Generator[bytes, None, None]:
    try:
        with closing(Process(LIMITS)) as process:
            yield from process.stream(
                f"{__name__}:{'parquet' if kind == PARQUET else 'mat'}_pieces", path, run
            )
    except (NoAnswer, RuntimeError) as error:
        # The status line is long sent: only an exception cuts the answer off, and keeps it from passing for
        # whole.
        raise StorageError(f"{path.name} could not be written as {kind}", "the log says why") from error


def parquet_pieces(path: Path, run: int) -> Generator[bytes, None, None]:
    """A capture's points as Parquet while it is written; called in the process."""
    reading, writing = os.pipe()

    def write() -> None:
        with os.fdopen(writing, "wb") as output:
            points_parquet(path, run, output)

    with ThreadPoolExecutor(1) as pool, os.fdopen(reading, "rb", buffering=0) as written:
        result = pool.submit(write)
        while chunk := written.read(CHUNK_BYTES):
            yield chunk
        result.result()


def mat_pieces(path: Path, run: int) -> Generator[bytes, None, None]:
    """A capture's points as a MAT-file, once it is written; called in the process."""
    # The sizes of a MAT-file are put in once they are known, which a pipe cannot do.
    with tempfile.TemporaryFile() as whole:
        points_mat(path, run, whole)
        whole.seek(0)
        while chunk := whole.read(CHUNK_BYTES):
            yield chunk
