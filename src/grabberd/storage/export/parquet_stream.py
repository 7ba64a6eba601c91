"""A capture's points as Parquet from a process of their own.

pyarrow is large, slow to import and keeps the interpreter to itself while it writes, so a daemon has a niced
child process do it, which writes to its standard output.
"""

import os
import selectors
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import IO

from grabberd.errors import StorageError
from grabberd.storage.export.parquet_file import check_parquet
from grabberd.storage.export.points_export import open_run, points_parquet
from grabberd.storage.patience import check_patience

CHUNK_BYTES = 65_536
LOOK_EVERY_S = 0.2
"""Interval at which to look whether somebody still waits."""
NICENESS = 10
CHILD = f"import sys; from {__name__} import main; main(*sys.argv[1:])"


def parquet_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """A Parquet file as it is written; errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound, ExtraMissing: See `points_parquet`.
    """
    check_parquet()
    reader, number = open_run(path, run)
    reader.close()
    return _from_child([sys.executable, "-P", "-c", CHILD, str(path), str(number)], path)


def _from_child(command: list[str], path: Path) -> Generator[bytes, None, None]:
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
        raise StorageError(f"{path.name} could not be written as Parquet", "the log says why")


def _read(output: IO[bytes], path: Path) -> bytes:
    """The next bytes of a child, as soon as there are some; none at its end."""
    with selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        while not selector.select(LOOK_EVERY_S):
            check_patience(path.name)
    return os.read(output.fileno(), CHUNK_BYTES)


def main(file: str, run: str) -> None:
    """Writes one capture's points to standard output."""
    os.nice(NICENESS)
    points_parquet(Path(file), int(run), sys.stdout.buffer)
    sys.stdout.buffer.flush()
