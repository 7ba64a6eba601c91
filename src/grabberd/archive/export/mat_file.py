"""Points of a run, and any other tables, as MAT-files of version 5, which MATLAB, Octave, Julia and R open.

Points are dense arrays over fields and targets, NaN where there is no point. A written file is checked tag by
tag: every variable and field, with the size that it was to have.
scipy.io is slow to import, so it is imported where something is written.
The format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.reading_groups import RecordedChannel
from grabberd.archive.export.point_grid import PointGrid, known_model
from grabberd.archive.export.points_columns import GRID_ARRAYS, GRID_COLUMNS, POINT_COLUMNS, moments
from grabberd.archive.export.points_export import LEDGER_COLUMNS, ledger_rows, points_about, points_file
from grabberd.core.chain.columns import Column, Table
from grabberd.errors import InputError
from grabberd.files.checked_file import Check

MOST_BYTES = (1 << 31) - (1 << 20)
"""Bytes of a variable: MATLAB reads 2 GiB of this version; the rest is for names and tags."""
LONGEST_NAME = 63
"""Characters of a name of a variable or of a field of one."""

_CELL_BYTES = 64
"""Bytes of a cell beside its text."""

Struct = Mapping[str, Any]
"""Fields of a variable by name: arrays, texts, numbers, lists, mappings, None or further structs of them."""
_HEAD_BYTES = 128
_BEGINS = b"MATLAB 5.0 MAT-file"
_MATRIX, _STRUCT = 14, 2
_DTYPES = {column.name: column.dtype for column in POINT_COLUMNS}
CELL_BYTES = sum(np.dtype(_DTYPES[name]).itemsize for names in GRID_ARRAYS.values() for name in names)
"""Bytes of the points of one target in one field."""
_HINT = "take csv or parquet, which have no such limit"
_REMOTE_HINT = "download the capture, and write it there: grabberd export CAPTURE --format mat --out FOLDER"
STREAM_BYTES = 600_000_000
"""Bytes of the points of a download: the process that makes it shares the memory of the daemon."""


def write_mat(file: IO[bytes], variables: Mapping[str, Struct]) -> None:
    """Writes structs into an open, seekable file.

    Args:
        file: The file.
        variables: Structs by name, their values as `mat_column` and `mat_value` make them.

    Raises:
        InputError: One is larger than the format, or MATLAB, takes it.
    """
    from scipy.io import savemat  # noqa: PLC0415

    for name, fields in variables.items():
        check_size(name, _bytes(fields), MOST_BYTES, "csv, parquet and hdf5 have no such limit")
    savemat(cast("Any", file), variables, long_field_names=True)  # the stubs know names of files alone


def check_size(name: str, size: int, most: int, hint: str) -> None:
    """Refuses a variable that has too many bytes.

    Raises:
        InputError: It has.
    """
    if size > most:
        raise InputError(
            f"`{name}` would take {size / 1e9:.1f} GB of a MAT-file, and {most / 1e9:.1f} GB are possible",
            hint,
        )


def table_struct(table: Table) -> Struct:
    """A table as a struct of columns, all of them (N, 1): `struct2table` makes a table of it."""
    return {column.name: mat_column(table.column(column.name)) for column in table.columns}


def mat_column(values: NDArray[Any]) -> NDArray[Any]:
    """(N, 1) values of a column: texts as cells, and whole numbers as doubles.

    MATLAB calculates with integers in integers: n / 50 would be rounded to whole seconds.
    """
    return (values.astype(np.float64) if values.dtype.kind in "iu" else values).reshape(-1, 1)


def mat_value(value: object) -> Any:
    """A value of a JSON document: a mapping is a cell array of names and values, None an empty text.

    Names from outside, such as those of labels, are not all names that a field of a struct can have.
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return np.bool_(value)
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, Mapping):
        return _cells([(name, mat_value(one)) for name, one in value.items()], 2)
    if isinstance(value, Iterable) and not isinstance(value, str):
        return _cells([(mat_value(one),) for one in value], 1)
    return str(value)


def described(columns: Iterable[Column]) -> tuple[Struct, Struct]:
    """Units and meanings of columns by their names."""
    known = tuple(columns)
    return {one.name: one.unit for one in known}, {one.name: one.meaning for one in known}


def _cells(rows: Sequence[tuple[object, ...]], columns: int) -> NDArray[Any]:
    cells = np.empty((len(rows), columns), object)
    for i, row in enumerate(rows):
        for k, one in enumerate(row):
            cells[i, k] = one
    return cells


def _bytes(value: object) -> int:
    if isinstance(value, Mapping):
        return sum(_bytes(one) for one in value.values())
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        return sum(_bytes(one) + _CELL_BYTES for one in value.flat)
    return value.nbytes if isinstance(value, np.ndarray) else 4 * len(str(value))


class _Array(NamedTuple):
    """The beginning of an array, and the place in the file where it ends."""

    kind: int
    shape: tuple[int, ...]
    name: str
    end: int


def mat_check(variables: Mapping[str, Struct]) -> Check:
    """A MAT-file with these structs, whose fields have the sizes of theirs."""

    def check(path: Path) -> str | None:
        with path.open("rb") as file:
            if not file.read(_HEAD_BYTES).startswith(_BEGINS):
                return "it does not begin as a MAT-file"
            found = dict(_variables(file, path.stat().st_size))
        if list(found) != list(variables):
            return f"its variables are {', '.join(found)}"
        for name, expected in variables.items():
            if list(found[name]) != list(expected):
                return f"the fields of {name} are {', '.join(found[name])}"
            for field, value in expected.items():
                if found[name][field] != _shape(value):
                    return f"{name}.{field} has the size {found[name][field]}, expected {_shape(value)}"
        return None

    return check


def _shape(value: object) -> tuple[int, ...]:
    if isinstance(value, str):
        return (1, len(value)) if value else (0, 0)
    return np.shape(value) if isinstance(value, np.ndarray) else (1, 1)


def _variables(file: IO[bytes], size: int) -> Iterator[tuple[str, dict[str, tuple[int, ...]]]]:
    """Name of each struct, and the sizes of its fields."""
    while file.tell() < size:
        array = _array(file)
        fields = dict(_fields(file)) if array.kind == _STRUCT else {}
        if file.tell() != array.end or array.end > size:
            raise ValueError(f"{array.name} ends at {file.tell()}, expected {array.end} of {size} bytes")
        yield array.name, fields


def _fields(file: IO[bytes]) -> Iterator[tuple[str, tuple[int, ...]]]:
    (length,) = struct.unpack("<i", _values(file))
    names = _values(file)
    for first in range(0, len(names), length):
        array = _array(file)
        file.seek(array.end)
        yield names[first : first + length].rstrip(b"\0").decode("ascii"), array.shape


def _array(file: IO[bytes]) -> _Array:
    kind, size = struct.unpack("<II", file.read(8))
    if kind != _MATRIX:
        raise ValueError(f"an element of type {kind} at {file.tell() - 8}")
    end = file.tell() + size
    flags, dimensions, name = (_values(file) for _ in range(3))
    shape = struct.unpack(f"<{len(dimensions) // 4}i", dimensions)
    return _Array(flags[0], shape, name.decode("ascii"), end)


def _values(file: IO[bytes]) -> bytes:
    """The values of an element; up to four bytes of them stand in its tag."""
    kind, size = struct.unpack("<II", tag := file.read(8))
    if kind >> 16:
        return tag[4 : 4 + (kind >> 16)]
    values = file.read(size)
    file.seek(-size % 8, os.SEEK_CUR)
    return values


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
    return {name: _cells([(row[name],) for row in rows], 1) for name in (rows[0] if rows else ())}


def _channel(reader: CaptureReader, channel: RecordedChannel) -> dict[str, Any]:
    readings, calibration = reader.channels.readings(channel), channel.calibration
    return {
        "name": channel.name,
        "quantity": str(channel.quantity),
        "logger": channel.logger,
        "time_s": mat_column(readings.time_s),
        "sigma_time_s": mat_column(readings.time_sigma_ns / 1e9),
        "vacuum_kpa": mat_column(readings.kpa if channel.quantity.is_vacuum else np.empty(0)),
        "value": mat_column(readings.value),
        "unit": calibration.unit,
        "sigma_vacuum_kpa": calibration.sigma_kpa,
        "sigma_delay_s": calibration.delay_sigma_ms / 1e3,
    }


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
