"""The points of a run as a MAT-file: dense arrays over fields and targets, NaN where there is no point."""

from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.channels.reading_groups import RecordedChannel
from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.ledger_file import LEDGER_COLUMNS, ledger_rows
from grabberd.archive.export.mat_check import mat_check
from grabberd.archive.export.mat_file import (
    MOST_BYTES,
    Struct,
    check_size,
    described,
    mat_column,
    mat_value,
    write_mat,
)
from grabberd.archive.export.point_grid import PointGrid, known_model
from grabberd.archive.export.points_columns import GRID_ARRAYS, GRID_COLUMNS, POINT_COLUMNS, moments
from grabberd.archive.export.points_export import points_about, points_file

_DTYPES = {column.name: column.dtype for column in POINT_COLUMNS}
CELL_BYTES = sum(np.dtype(_DTYPES[name]).itemsize for names in GRID_ARRAYS.values() for name in names)
"""Bytes of one target in one field."""
_HINT = "take csv or parquet, which have no such limit"
_REMOTE_HINT = "download the capture, and write it there: grabberd export CAPTURE --format mat --out FOLDER"
STREAM_BYTES = 600_000_000
"""Bytes of the points of a download: the process that makes it shares the memory of the daemon."""


def points_mat(path: Path, run: int | None, file: IO[bytes]) -> int:
    """Writes a MAT-file into an open, seekable file; returns the number of points.

    Raises:
        CaptureFileError, NotFound: No such file or run.
        InputError: It has more fields and targets than the format has room for.
    """
    with PointGrid.open(path, run) as grid:
        write_mat(file, point_variables(grid))
        return grid.points


def export_mat(
    path: Path, directory: Path, run: int | None = None, left_out: list[Damage] | None = None
) -> int:
    """Writes `points.mat` and `ledger.csv` into a folder; returns the number of points.

    Raises:
        CaptureFileError, NotFound, InputError, StorageError: See `points_mat` and `export_csv`.
    """
    with PointGrid.open(path, run, left_out) as grid:
        variables = point_variables(grid)
        with points_file(path, directory, "points.mat", mat_check(variables), left_out) as file:
            write_mat(file, variables)
        return grid.points


def check_stream_size(reader: CaptureReader, run: int) -> None:
    """Refuses points that a download is too small for, by what is known of them without reading them.

    Raises:
        InputError: They are too many.
    """
    model = known_model(reader.run(run))
    targets = 0 if model is None else len(model)
    check_size("points", reader.field_span * targets * CELL_BYTES, STREAM_BYTES, _REMOTE_HINT)


def point_variables(grid: PointGrid) -> Mapping[str, Struct]:
    """Variables of the file: points, ledger, units, meanings, and what all of it was made from.

    Raises:
        InputError: They have more bytes than a variable can have.
    """
    check_size("points", grid.fields * len(grid.targets) * CELL_BYTES, MOST_BYTES, _HINT)
    units, meanings = described(GRID_COLUMNS)
    channels = _channels(grid.reader)
    return {
        "points": _points(grid),
        "ledger": _ledger(grid.reader),
        **({"channels": channels} if channels else {}),
        "units": {"points": units},
        "meanings": {"points": meanings},
        "about": {name: mat_value(value) for name, value in _about(grid).items()},
    }


def _ledger(reader: CaptureReader) -> Struct:
    rows = ledger_rows(reader.ledger)
    kinds = (np.int64, np.int64, object, object, object)
    return {
        name: mat_column(np.array([row[k] for row in rows], kind))
        for k, (name, kind) in enumerate(zip(LEDGER_COLUMNS, kinds, strict=True))
    }


def _channels(reader: CaptureReader) -> Struct:
    """The channels as columns of cells, a row for each channel; all of their readings, at their own times.

    Times count from the first field, as those of the points.
    """
    rows = [_channel(reader, one) for one in reader.channels.all]
    return {name: _cells([row[name] for row in rows]) for name in (rows[0] if rows else ())}


def _channel(reader: CaptureReader, channel: RecordedChannel) -> dict[str, Any]:
    groups, calibration = list(reader.channels.groups(channel)), channel.calibration
    begin_ns = reader.first_time_ns or 0
    time_s = [(one.time_ns - begin_ns) / 1e9 for one in groups]
    sigma_s = [np.full(len(one.time_ns), one.time_sigma_ns / 1e9) for one in groups]
    value = np.concatenate([np.empty(0), *(one.value for one in groups)])
    return {
        "name": channel.name,
        "quantity": str(channel.quantity),
        "logger": channel.logger,
        "time_s": mat_column(np.concatenate([np.empty(0), *time_s])),
        "sigma_time_s": mat_column(np.concatenate([np.empty(0), *sigma_s])),
        "vacuum_kpa": mat_column(calibration.kpa(value) if channel.quantity.is_vacuum else np.empty(0)),
        "value": mat_column(value),
        "unit": calibration.unit,
        "sigma_vacuum_kpa": calibration.sigma_kpa,
        "sigma_delay_s": calibration.delay_sigma_ms / 1e3,
    }


def _cells(values: list[Any]) -> NDArray[Any]:
    cells = np.empty((len(values), 1), object)
    for row, value in enumerate(values):
        cells[row, 0] = value
    return cells


def _points(grid: PointGrid) -> Struct:
    targets = grid.targets
    arrays = _arrays(grid)
    return {
        "n": mat_column(grid.first_n + np.arange(grid.fields)),
        "time_s": mat_column(_times_s(grid)),
        "target": mat_column(targets.target).T,
        "row": targets.row[np.newaxis],
        "column": targets.column[np.newaxis],
        "nominal_mm": targets.nominal_mm,
        **arrays,
    }


def _arrays(grid: PointGrid) -> dict[str, NDArray[Any]]:
    """Arrays of all fields and targets, in the order in which MATLAB has them in memory."""
    shape = grid.fields, len(grid.targets)
    arrays = {
        name: np.full((*shape, len(columns)), np.nan, _DTYPES[columns[0]], order="F")
        for name, columns in GRID_ARRAYS.items()
    }
    for fields, places, rows in grid.parts():
        for name, columns in GRID_ARRAYS.items():
            for k, column in enumerate(columns):
                arrays[name][fields, places, k] = rows[column]
    return {name: values[:, :, 0] if values.shape[2] == 1 else values for name, values in arrays.items()}


def _times_s(grid: PointGrid) -> NDArray[np.float64]:
    """(F,) times of the fields; NaN for those that are not in the file, whose times nobody knows."""
    n, time_ns = grid.reader.field_times()
    times_s = np.full(grid.fields, np.nan)
    within = n < grid.first_n + grid.fields
    times_s[n[within] - grid.first_n] = (time_ns[within] - (grid.reader.first_time_ns or 0)) / 1e9
    return times_s


def _about(grid: PointGrid) -> dict[str, Any]:
    about, reader = points_about(grid.reader, grid.run.run), grid.reader
    first = moments(np.array([reader.first_time_ns or 0]), reader.meta)[0]
    return {
        **about,
        "rate_hz": reader.meta.rate_hz,
        "first_field_utc": "" if np.isnat(first) else f"{first}Z",
    }
