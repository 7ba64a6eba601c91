"""Points of a capture as Parquet, whose columns carry their units.

pyarrow is large, slow to import and keeps the interpreter to itself while it writes, so a daemon has it work
in a niced process of its own, which writes to its standard output.
"""

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Generator
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from grabberd.errors import ExtraMissing, StorageError
from grabberd.storage.capture.reader import CaptureReader
from grabberd.storage.export.columns import COLUMNS, Rows
from grabberd.storage.export.csv_ply import open_run, rows_by_field

if TYPE_CHECKING:
    import pyarrow as pa  # type: ignore[import-untyped]

FIELDS_A_GROUP = 500
CHUNK_BYTES = 65_536
NICENESS = 10
CHILD = f"import sys; from {__name__} import main; main(*sys.argv[1:])"


def check_parquet() -> None:
    """Whether what writes Parquet is installed, without importing it.

    Raises:
        ExtraMissing: it is not.
    """
    if importlib.util.find_spec("pyarrow") is None:
        raise ExtraMissing("Parquet", "parquet")


def write_parquet(path: Path, run: int | None, file: IO[bytes]) -> int:
    """Writes the points of a run into an open file, which need not be seekable; returns how many.

    Raises:
        CaptureFileError, NotFound: no such file or run.
        ExtraMissing: pyarrow is not installed.
    """
    check_parquet()
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415

    reader, number = open_run(path, run)
    count = 0
    with reader, pq.ParquetWriter(_Sink(file), _schema(reader, number), compression="zstd") as writer:
        fields = rows_by_field(reader, number)
        while group := list(islice(fields, FIELDS_A_GROUP)):
            batch = pa.record_batch(_columns(group), schema=writer.schema)
            writer.write_batch(batch)
            count += batch.num_rows
    return count


def parquet_stream(path: Path, run: int | None = None) -> Generator[bytes, None, None]:
    """The same from a process of its own, as it comes; the errors are raised at once, before the first bytes.

    Raises:
        CaptureFileError, NotFound, ExtraMissing: see `write_parquet`.
    """
    check_parquet()
    reader, number = open_run(path, run)
    reader.close()
    return _from_child([sys.executable, "-c", CHILD, str(path), str(number)], path)


def _from_child(command: list[str], path: Path) -> Generator[bytes, None, None]:
    with subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL) as child:  # noqa: S603
        assert child.stdout is not None
        try:
            while chunk := child.stdout.read(CHUNK_BYTES):
                yield chunk
            child.wait()
        finally:  # whoever asked has gone
            if child.poll() is None:
                child.kill()
    if child.returncode:
        raise StorageError(f"{path.name} could not be written as Parquet", "the log says why")


class _Sink:
    """A file that is only written to, for a library that asks where it is."""

    closed = False

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._place = 0

    def write(self, data: Any) -> int:
        written = len(memoryview(data))
        self._file.write(data)
        self._place += written
        return written

    def tell(self) -> int:
        return self._place

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self.closed = True

    def readable(self) -> bool:
        return False

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False


def _schema(reader: CaptureReader, run: int) -> "pa.Schema":
    import pyarrow as pa  # noqa: PLC0415

    metadata = {"grabberd": json.dumps(_about(reader, run), ensure_ascii=False)}
    return pa.schema(point_fields(), metadata=metadata)


def point_fields() -> "list[pa.Field]":
    """The columns with their types, units and meanings."""
    import pyarrow as pa  # noqa: PLC0415

    kinds = {"i4": pa.int32(), "f4": pa.float32(), "f8": pa.float64(), "M8[ms]": pa.timestamp("ms", "UTC")}
    return [
        pa.field(one.name, kinds[one.kind], metadata={"unit": one.unit, "description": one.meaning})
        for one in COLUMNS
    ]


def _about(reader: CaptureReader, run: int) -> dict[str, Any]:
    meta, info = reader.meta, reader.run(run)
    return {
        "capture": meta.id,
        "created_utc": meta.created_utc,
        "run": run,
        "run_created_utc": info.created_utc,
        "version": info.version,
        "calibration": (info.made_with["calibration"] or {}).get("id"),
        "site": meta.site,
        "labels": meta.labels,
        "note": meta.note,
    }


def _columns(group: list[Rows]) -> list[np.ndarray[Any, Any]]:
    return [np.concatenate([rows[column.name] for rows in group]) for column in COLUMNS]


def main(file: str, run: str) -> None:
    """One capture's points to standard output."""
    os.nice(NICENESS)
    write_parquet(Path(file), int(run), sys.stdout.buffer)
    sys.stdout.buffer.flush()
