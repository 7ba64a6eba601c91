"""Points of a capture as CSV and PLY, some fields at a time."""

import csv
import io
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from grabberd import __version__
from grabberd.errors import NotFound
from grabberd.storage.capture.reader import END, CaptureReader
from grabberd.storage.export.columns import COLUMNS, POINT_COLUMNS, Rows, moment_of, rows_of

PLY_TYPES = {"i4": "int", "f4": "float", "f8": "double"}
PLY_NAMES = {"x_mm": "x", "y_mm": "y", "z_mm": "z"}
"""What programs that draw clouds look for."""
PLY_COLUMNS = tuple(
    one for one in COLUMNS if one.kind in PLY_TYPES and not one.name.startswith(("left_", "right_"))
)
PLY_VERTEX = np.dtype([(column.name, f"<{column.kind}") for column in PLY_COLUMNS])
PLY_BYTES = PLY_VERTEX.itemsize
_FORMATS: dict[str, Callable[[Any], str]] = {"f4": "{:.6g}".format, "f8": repr, "i4": str}


def points_csv(path: Path, run: int | None = None) -> Generator[str, None, None]:
    """Text of a CSV file; the errors are raised at once, before the first text.

    Raises:
        CaptureFileError, NotFound: no such file or run.
    """
    reader, number = open_run(path, run)
    return _csv(reader, number)


def points_ply(path: Path, run: int | None = None, field: int | None = None) -> Generator[bytes, None, None]:
    """A PLY file (binary, little-endian): one cloud of all points of a run, or of one field's.

    Raises:
        CaptureFileError, NotFound: no such file, run, or points of that field; raised at once.
    """
    reader, number = open_run(path, run)
    first_n, end_n = (0, END) if field is None else (field, field + 1)
    count, end_n = reader.point_span(number, first_n, end_n)
    if field is not None and count == 0:
        reader.close()
        hint = "its ledger says which fields did not come; points?first_n=… shows those that have points"
        raise NotFound(f"run {number} of capture {reader.meta.id} has no points of field {field}", hint)
    return _ply(reader, number, first_n, end_n, count)


def open_run(path: Path, run: int | None) -> tuple[CaptureReader, int]:
    """A reader, which the caller closes, and the number of the run that is meant.

    Raises:
        CaptureFileError, NotFound: no such file or run.
    """
    reader = CaptureReader(path)
    try:
        return reader, reader.run(run).run
    except Exception:
        reader.close()
        raise


def rows_by_field(reader: CaptureReader, run: int, first_n: int = 0, end_n: int = END) -> Iterator[Rows]:
    """The points of a run, field by field."""
    first_ns = reader.first_time_ns or 0
    for n, time_ns, points in reader.timed_points(run, first_n, end_n):
        yield rows_of(n, (time_ns - first_ns) / 1e9, moment_of(time_ns, reader.meta), points)


def _csv(reader: CaptureReader, run: int) -> Generator[str, None, None]:
    with reader:
        yield ",".join(POINT_COLUMNS) + "\r\n"
        for rows in rows_by_field(reader, run):
            text = io.StringIO()
            csv.writer(text).writerows(zip(*_texts(rows), strict=True))
            yield text.getvalue()


def _texts(rows: Rows) -> Iterator[list[str]]:
    for column in COLUMNS:
        values = rows[column.name].tolist()
        if column.kind.startswith("M8"):
            yield ["" if one is None else f"{one.isoformat(timespec='milliseconds')}Z" for one in values]
        elif column.name == "time_s":
            yield [f"{one:.6f}" for one in values]
        else:
            yield [_FORMATS[column.kind](one) for one in values]


def _ply(
    reader: CaptureReader, run: int, first_n: int, end_n: int, count: int
) -> Generator[bytes, None, None]:
    with reader:
        yield _ply_head(reader, run, count).encode("ascii", "replace")
        for rows in rows_by_field(reader, run, first_n, end_n):
            vertices = np.empty(len(rows["n"]), PLY_VERTEX)
            for name in PLY_VERTEX.names or ():
                vertices[name] = rows[name]
            yield vertices.tobytes()


def _ply_head(reader: CaptureReader, run: int, count: int) -> str:
    lines = (
        "ply",
        "format binary_little_endian 1.0",
        f"comment grabberd {__version__}, capture {reader.meta.id}, run {run}",
        "comment x y z and their sigma in mm, time_s in s, residual in px",
        f"element vertex {count}",
        *(f"property {PLY_TYPES[one.kind]} {PLY_NAMES.get(one.name, one.name)}" for one in PLY_COLUMNS),
        "end_header",
    )
    return "\n".join(lines) + "\n"
