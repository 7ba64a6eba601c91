"""Points and channels of a capture, and any other tables, as HDF5.

There is a group for each table, and in it a plain array for each column with its unit and meaning.
"""

import importlib.util
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.export.channels_export import CHANNEL_COLUMNS, channel_rows
from grabberd.archive.export.points_columns import POINT_COLUMNS, rows_by_group
from grabberd.archive.export.points_export import (
    POINTS_A_GROUP,
    open_run,
    points_about,
    write_ledger_file,
    write_left_out_file,
)
from grabberd.archive.export.read_back import hdf5_check
from grabberd.core.chain.columns import Column, Rows, Table, regrouped
from grabberd.errors import ExtraMissing
from grabberd.files.checked_file import checked_path
from grabberd.files.disk import new_folder, storage_errors

if TYPE_CHECKING:
    import h5py  # type: ignore[import-untyped]


def check_hdf5() -> None:
    """Checks that h5py is installed, without importing it.

    Raises:
        ExtraMissing: It is not.
    """
    if importlib.util.find_spec("h5py") is None:
        raise ExtraMissing("HDF5", "hdf5")


def write_hdf5(
    path: Path, tables: Iterable[Table], about: Mapping[str, Any], arrays: Mapping[str, "ArrayGroup"]
) -> Path:
    """Writes a new file.

    Args:
        path: Its path.
        tables: Tables, a group each.
        about: Origin of the tables: the file's attribute `grabberd`, as JSON.
        arrays: Further groups by name, of arrays that are no columns.

    Raises:
        ExtraMissing: h5py is not installed.
        StorageError: The file cannot be written, or exists already.
    """
    check_hdf5()
    import h5py  # noqa: PLC0415

    with storage_errors(path), h5py.File(path, "x") as file:
        file.attrs["grabberd"] = json.dumps(about, ensure_ascii=False)
        for table in tables:
            _write_table(file, table)
        for name, (meaning, members) in arrays.items():
            group = _group(file, name, meaning)
            for member, values in members.items():
                group.create_dataset(member, data=values)
    return path


ArrayGroup = tuple[str, Mapping[str, NDArray[Any]]]
"""Meaning of a group, and its arrays by name."""


def _write_table(file: "h5py.File", table: Table) -> None:
    group = _group(file, table.name, table.meaning)
    for column in table.columns:
        _dataset(group, column, data=table.column(column.name))


def _group(file: "h5py.File", name: str, meaning: str | None = None) -> "h5py.Group":
    # Without tracked order, readers would list the columns by the alphabet.
    group = file.create_group(name, track_order=True)
    if meaning is not None:
        group.attrs["meaning"] = meaning
    return group


def _dataset(group: "h5py.Group", column: Column, **layout: Any) -> None:
    import h5py  # noqa: PLC0415

    # Variable-length strings are read by every HDF5 library, times of numpy by none.
    is_text = column.dtype == "U" or column.dtype.startswith("M8")
    dtype = h5py.string_dtype() if is_text else column.dtype
    dataset = group.create_dataset(column.name, dtype=dtype, **layout)
    dataset.attrs["unit"], dataset.attrs["meaning"] = column.unit, column.meaning


NAME = "points.h5"
_CHUNK = 16_384


def export_hdf5(
    path: Path, directory: Path, run: int | None = None, left_out: list[Damage] | None = None
) -> int:
    """Writes `points.h5` and `ledger.csv` into a folder; returns the number of points.

    Raises:
        CaptureFileError, NotFound, ExtraMissing, StorageError: See `points_parquet` and `export_csv`.
    """
    check_hdf5()
    reader, number = open_run(path, run, left_out)
    with reader:
        new_folder(directory)
        with storage_errors(directory):
            write_ledger_file(reader, directory)
        about, rows = points_about(reader, number), dict[str, int]()
        points = regrouped(POINT_COLUMNS, rows_by_group(reader, number), POINTS_A_GROUP)
        tables = {"points": (POINT_COLUMNS, points)}
        if reader.channels.all:
            tables["channels"] = (CHANNEL_COLUMNS, channel_rows(reader))
        check = hdf5_check({name: columns for name, (columns, _) in tables.items()}, rows)
        with checked_path(directory / NAME, check) as part:
            for name, (columns, parts) in tables.items():
                rows[name] = _add_table(part, about, name, columns, parts)
    with storage_errors(directory):
        write_left_out_file(left_out, directory)
    return rows["points"]


def _add_table(
    path: Path, about: Mapping[str, Any], name: str, columns: Sequence[Column], parts: Iterable[Rows]
) -> int:
    """Adds a table to a file, a part at a time; returns the number of its rows."""
    import h5py  # noqa: PLC0415

    with storage_errors(path), h5py.File(path, "a") as file:
        file.attrs["grabberd"] = json.dumps(about, ensure_ascii=False)
        group = _group(file, name)
        for column in columns:
            _dataset(group, column, shape=(0,), maxshape=(None,), chunks=(_CHUNK,))
        return sum(_append(group, columns, part) for part in parts)


def _append(group: "h5py.Group", columns: Sequence[Column], rows: Rows) -> int:
    count = 0
    for column in columns:
        values, dataset = _stored(column.array(rows[column.name])), group[column.name]
        count, begin = len(values), len(dataset)
        dataset.resize((begin + count,))
        dataset[begin:] = values
    return count


def _stored(values: NDArray[Any]) -> NDArray[Any]:
    """Values as HDF5 has them: moments as text of ISO 8601, empty where there is none."""
    if values.dtype.kind != "M":
        return values
    texts = np.char.add(np.datetime_as_string(values), "Z")
    return np.where(np.isnat(values), "", texts).astype(object)
