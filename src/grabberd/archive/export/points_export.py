"""Points of a capture as CSV, PLY and Parquet: streams and files, some fields at a time.

`ledger.csv` stands beside whatever is exported, and `left_out.csv` where the disk has damaged something.
"""

import json
import math
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from grabberd import __version__
from grabberd.archive.capture.digests import END, MISSING, Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import reading_errors
from grabberd.archive.export.channels_export import export_channels
from grabberd.archive.export.points_columns import CLOUD_COLUMNS, POINT_COLUMNS, rows_by_group
from grabberd.archive.export.read_back import csv_check, parquet_check, ply_check
from grabberd.archive.export.table_files import (
    COMMAS,
    CsvDialect,
    cells,
    check_parquet,
    csv_lines,
    csv_text,
    ply_head,
    ply_vertex,
    ply_vertices,
    write_csv,
    write_parquet,
)
from grabberd.core.chain.columns import regrouped
from grabberd.core.geometry.local_field import PATTERNS
from grabberd.core.ledger import Ledger, cause_of_loss
from grabberd.documents.captures import CorrectionDocument, ViewCorrection
from grabberd.errors import NotFound
from grabberd.files.checked_file import Check, checked_file, write_checked
from grabberd.files.disk import new_folder, storage_errors

POINTS_A_GROUP = 40_000
"""Points in a row group of Parquet, and so in memory at once: about ten seconds of them."""
LEDGER = "ledger.csv"
LEDGER_COLUMNS = ("first_n", "count", "outcome", "cause", "reason")
CORRECTIONS = "corrections.csv"
CORRECTION_COLUMNS = (
    *(
        "first_n",
        "view",
        "state",
        "marks",
        "shift_x_px",
        "shift_y_px",
        "sigma_shift_x_px",
        "sigma_shift_y_px",
    ),
    *(f"{pattern}_px" for pattern in PATTERNS),
    *(f"sigma_{pattern}_px" for pattern in PATTERNS),
)
LEFT_OUT = "left_out.csv"
LEFT_OUT_COLUMNS = Damage._fields
REBASE = "rebase"
"""Outcome of a row that counts no fields: a change of what numbers and times go by from that field on."""


def points_csv(
    path: Path, run: int | None = None, left_out: list[Damage] | None = None, dialect: CsvDialect = COMMAS
) -> Generator[str, None, None]:
    """Text of a CSV file; errors are raised at once, before the first text.

    Raises:
        CaptureFileError, NotFound: No such file or run.
    """
    reader, number = open_run(path, run, left_out)
    return _csv(reader, number, dialect)


def points_ply(
    path: Path, run: int | None = None, field: int | None = None, left_out: list[Damage] | None = None
) -> Generator[bytes, None, None]:
    """A PLY file (binary, little-endian): one cloud of all points of a run, or of one field's.

    Raises:
        CaptureFileError, NotFound: No such file, run, or points of that field; raised at once.
    """
    first_n, end_n = (0, END) if field is None else (field, field + 1)
    reader, number = open_run(path, run, left_out, first_n, end_n)
    # The head of the file comes first and has the number of points; a capture that is being recorded gets
    # more of them meanwhile, beyond the end that belongs to this number.
    count, end_n = reader.point_span(number, first_n, end_n)
    if field is not None and count == 0:
        reader.close()
        hint = "its ledger says which fields did not come; points?first_n=… shows those that have points"
        raise NotFound(f"run {number} of capture {reader.meta.id} has no points of field {field}", hint)
    if left_out is not None:
        missing = len(left_out)
        count = sum(len(points) for _, _, points in reader.timed_points(number, first_n, end_n))
        del left_out[missing:]  # damaged ones come again
    return _ply(reader, number, first_n, end_n, count)


def points_parquet(path: Path, run: int | None, file: IO[bytes], left_out: list[Damage] | None = None) -> int:
    """Writes a Parquet file into an open file, which need not be seekable; returns the number of points.

    Raises:
        CaptureFileError, NotFound: No such file or run.
        ExtraMissing: pyarrow is not installed.
    """
    check_parquet()
    reader, number = open_run(path, run, left_out)
    with reader:
        parts = regrouped(POINT_COLUMNS, rows_by_group(reader, number), POINTS_A_GROUP)
        metadata = {"grabberd": json.dumps(points_about(reader, number), ensure_ascii=False)}
        return write_parquet(file, POINT_COLUMNS, parts, metadata)


def open_run(
    path: Path, run: int | None, left_out: list[Damage] | None = None, first_n: int = 0, end_n: int = END
) -> tuple[CaptureReader, int]:
    """A reader, which the caller closes, and the number of the run that is meant.

    Args:
        path: The capture.
        run: Number of the run; None: the latest.
        left_out: Takes up damaged points. None: they are an error, raised here, since whoever sends points
            could not take back what was sent before it came to them.
        first_n: Number of the first field that is wanted.
        end_n: Number after the last.

    Raises:
        CaptureFileError, NotFound: No such file or run, or its points are damaged.
    """
    reader = CaptureReader(path, left_out)
    try:
        number = reader.run(run).run
        if left_out is None:
            reader.check_numbers(number, first_n, end_n)
            reader.check_points(number, first_n, end_n)
        else:
            left_out += _missing_points(path, number, first_n, end_n)
        return reader, number
    except Exception:
        reader.close()
        raise


def _missing_points(path: Path, run: int, first_n: int, end_n: int) -> list[Damage]:
    """Points that have a digest and are not there; only their digests tell of them."""
    found: list[Damage] = []
    with CaptureReader(path, found) as reader:
        reader.check_points(run, first_n, end_n)
    return [damage for damage in found if damage.reason == MISSING]


def export_csv(
    path: Path,
    directory: Path,
    run: int | None = None,
    left_out: list[Damage] | None = None,
    dialect: CsvDialect = COMMAS,
) -> int:
    """Writes `points.csv`, `ledger.csv` and, if there are channels, `channels.csv` into a folder; returns the
    number of points.

    Args:
        path: The capture.
        directory: A new or empty folder.
        run: Number of the run; None: the latest.
        left_out: Takes up damaged points, which are left out and listed in `left_out.csv`; None: they are an
            error.
        dialect: Signs of all these files.

    Raises:
        CaptureFileError, NotFound: No such file or run.
        StorageError: The folder cannot be written, or is not empty.
    """
    text = points_csv(path, run, left_out, dialect)
    rows = 0
    check = csv_check([column.name for column in POINT_COLUMNS], lambda: rows, dialect.separator)
    with points_file(path, directory, "points.csv", check, left_out, dialect) as file:
        rows = write_csv(file, text)
        export_channels(path, directory, "csv", left_out, dialect)
        _export_corrections(path, directory, run, dialect)
    return rows


def export_ply(
    path: Path,
    directory: Path,
    run: int | None = None,
    left_out: list[Damage] | None = None,
    field: int | None = None,
) -> int:
    """Writes `points.ply` into a folder, of all fields or of one; returns the number of points.

    Raises:
        CaptureFileError, NotFound, StorageError: See `points_ply` and `export_csv`.
    """
    parts, points = points_ply(path, run, field, left_out), 0
    with points_file(path, directory, "points.ply", ply_check(lambda: points), left_out) as file:
        file.write(next(parts))
        points = sum(file.write(part) for part in parts) // ply_vertex(CLOUD_COLUMNS).itemsize
    return points


def export_parquet(
    path: Path, directory: Path, run: int | None = None, left_out: list[Damage] | None = None
) -> int:
    """Writes `points.parquet`, `ledger.csv` and, if there are channels, `channels.parquet` into a folder;
    returns the number of points.

    Raises:
        CaptureFileError, NotFound, ExtraMissing, StorageError: See `points_parquet` and `export_csv`.
    """
    check_parquet()
    reader, number = open_run(path, run, None if left_out is None else [])
    reader.close()
    points = 0
    check = parquet_check([column.name for column in POINT_COLUMNS], lambda: points)
    with points_file(path, directory, "points.parquet", check, left_out) as file:
        points = points_parquet(path, number, file, left_out)
        export_channels(path, directory, "parquet", left_out)
        _export_corrections(path, directory, number)
    return points


def _export_corrections(path: Path, directory: Path, run: int | None, dialect: CsvDialect = COMMAS) -> None:
    with CaptureReader(path) as reader:
        write_corrections_file(reader, reader.run_number(run), directory, dialect)


def _csv(reader: CaptureReader, run: int, dialect: CsvDialect) -> Generator[str, None, None]:
    with reader:
        yield from csv_text(POINT_COLUMNS, rows_by_group(reader, run), dialect)


def _ply(
    reader: CaptureReader, run: int, first_n: int, end_n: int, count: int
) -> Generator[bytes, None, None]:
    comments = (
        f"grabberd {__version__}, capture {reader.meta.id}, run {run}",
        "x y z and their sigma in mm, time_s in s, residual in px",
    )
    with reader:
        yield ply_head(CLOUD_COLUMNS, count, comments)
        for rows in rows_by_group(reader, run, first_n, end_n):
            yield ply_vertices(CLOUD_COLUMNS, rows)


def points_about(reader: CaptureReader, run: int) -> dict[str, Any]:
    """Origin of the points of a run, for the formats that have room for it."""
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
        "verdict": (info.coverage or {}).get("verdict"),
    }


@contextmanager
def points_file(
    capture: Path,
    directory: Path,
    name: str,
    check: Check,
    left_out: list[Damage] | None,
    dialect: CsvDialect = COMMAS,
) -> Iterator[IO[bytes]]:
    """A file in a new folder, beside the capture's ledger; it is read back by `check`."""
    new_folder(directory)
    with storage_errors(directory), CaptureReader(capture) as reader:
        write_ledger_file(reader, directory, dialect)
        with checked_file(directory / name, check) as file:
            yield file
        write_left_out_file(left_out, directory, dialect)


def write_ledger_file(reader: CaptureReader, directory: Path, dialect: CsvDialect = COMMAS) -> None:
    """Writes `ledger.csv`: a row for each entry and each rebase, in order; only a header for a good capture.

    Raises:
        CaptureFileError: The capture is damaged.
        StorageError: The file cannot be written, or is there already.
    """
    _write(directory / LEDGER, LEDGER_COLUMNS, ledger_rows(reader.ledger), dialect)


def write_corrections_file(
    reader: CaptureReader, run: int, directory: Path, dialect: CsvDialect = COMMAS
) -> None:
    """Writes `corrections.csv`: what was taken off either view, from which field on; none without marks.

    Raises:
        CaptureFileError: The capture is damaged.
        StorageError: The file cannot be written, or is there already.
    """
    stored = (reader.run(run).coverage or {}).get("corrections")
    if not stored:
        return
    with reading_errors(reader.path):
        known = [CorrectionDocument.model_validate(one) for one in stored]
    views = ((one.n, name, getattr(one, name)) for one in known for name in ("left", "right"))
    rows = [(n, name, *_correction_cells(view)) for n, name, view in views]
    _write(directory / CORRECTIONS, CORRECTION_COLUMNS, rows, dialect)


def _correction_cells(view: ViewCorrection) -> tuple[object, ...]:
    values = (view.shift_px, view.shift_sigma_px, view.pattern_px, view.pattern_sigma_px)
    counts = (2, 2, len(PATTERNS), len(PATTERNS))
    numbers = (known or [math.nan] * count for known, count in zip(values, counts, strict=True))
    return (str(view.state), view.marks, *(one for known in numbers for one in known))


def write_left_out_file(
    left_out: Sequence[Damage] | None, directory: Path, dialect: CsvDialect = COMMAS
) -> None:
    """Writes `left_out.csv`, what the disk has damaged and is not among the results; none if all was sound.

    Raises:
        StorageError: The file cannot be written.
    """
    if left_out:
        _write(directory / LEFT_OUT, LEFT_OUT_COLUMNS, left_out, dialect)


def _write(
    path: Path, columns: Sequence[str], rows: Sequence[tuple[object, ...]], dialect: CsvDialect
) -> None:
    text = dialect.mark + csv_lines([columns, *map(cells, rows)], dialect)
    write_checked(path, [text.encode()], csv_check(columns, rows.__len__, dialect.separator))


def ledger_rows(ledger: Ledger) -> list[tuple[int, int, str, str, str]]:
    """Rows of `LEDGER_COLUMNS`: one for each entry and each rebase, in order."""
    return sorted(_rows(ledger))


def _rows(ledger: Ledger) -> Iterator[tuple[int, int, str, str, str]]:
    for entry in ledger.entries:
        cause = cause_of_loss(entry.outcome, entry.reason)
        yield entry.first_n, entry.count, str(entry.outcome), str(cause), entry.reason
    for event in ledger.events:
        yield event.n, 0, REBASE, str(event.kind), event.reason
