"""A capture's points as Parquet or as a MAT-file, from a process of their own.

pyarrow and scipy.io are large, slow to import and keep the interpreter to themselves while they write, so a
daemon has a niced child process do it, which writes to its standard output.
"""

import os
import selectors
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import IO

from grabberd.archive.export.mat_file import check_stream_size, points_mat
from grabberd.archive.export.points_export import open_run, points_parquet
from grabberd.archive.export.table_files import check_parquet
from grabberd.errors import StorageError
from grabberd.files.patience import check_patience

CHUNK_BYTES = 65_536
LOOK_EVERY_S = 0.2
"""Interval at which to look whether somebody still waits."""
NICENESS = 10
CHILD = f"import sys; from {__name__} import main; main(*sys.argv[1:])"
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
    command = [sys.executable, "-P", "-c", CHILD, kind, str(path), str(run)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL) as child:  # noqa: S603
        assert child.stdout is not None
        try:
            while chunk := _read(child.stdout, path):
                yield chunk
            child.wait()
        finally:
            if child.poll() is None:  # nobody waits any longer: leaving the block would wait for the child
                child.kill()
    # The status line is long sent; only an exception cuts the answer off, so that it is not taken for whole.
    if child.returncode:
        raise StorageError(f"{path.name} could not be written as {kind}", "the log says why")


def _read(output: IO[bytes], path: Path) -> bytes:
    """The next bytes of a child, as soon as there are some; none at its end."""
    with selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        while not selector.select(LOOK_EVERY_S):
            check_patience(path.name)
    return os.read(output.fileno(), CHUNK_BYTES)


def main(kind: str, file: str, run: str) -> None:
    """Writes one capture's points to standard output."""
    os.nice(NICENESS)
    if kind == PARQUET:
        points_parquet(Path(file), int(run), sys.stdout.buffer)
    else:
        # The sizes of a MAT-file are put in once they are known, which a pipe cannot do.
        with tempfile.TemporaryFile() as whole:
            points_mat(Path(file), int(run), whole)
            whole.seek(0)
            shutil.copyfileobj(whole, sys.stdout.buffer)
    sys.stdout.buffer.flush()
