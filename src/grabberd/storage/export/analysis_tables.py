"""The tables of an analysis as CSV, Parquet and HDF5: plain columns, with units beside them."""

import csv
import importlib.util
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from grabberd.analysis import Grid
from grabberd.errors import ExtraMissing
from grabberd.processes.analysis.tables import AnalysisTables, Table
from grabberd.storage.capture.schema import storage_errors

if TYPE_CHECKING:
    import h5py  # type: ignore[import-untyped]

HDF5_NAME = "analysis.h5"
DIGITS = 7
"""Of numbers in CSV; σ begin far before the last."""

_EXTRAS = {"parquet": ("pyarrow", "Parquet"), "hdf5": ("h5py", "HDF5")}


def check_installed(format: str) -> None:
    """Whether what writes this format is installed, without importing it.

    Raises:
        ExtraMissing: it is not.
    """
    module, name = _EXTRAS.get(format, (None, format))
    if module is not None and importlib.util.find_spec(module) is None:
        raise ExtraMissing(name, format)


def write_csv(folder: Path, tables: AnalysisTables) -> list[Path]:
    """A file for each table; a number that there is not is empty.

    Raises:
        StorageError: a file cannot be written.
    """
    return [_csv(folder / f"{table.name}.csv", table) for table in tables.values()]


def _csv(path: Path, table: Table) -> Path:
    with storage_errors(path), path.open("x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in table.columns])
        writer.writerows(zip(*(_texts(column.values) for column in table.columns), strict=True))
    return path


def _texts(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind != "f":
        return [str(value) for value in values.tolist()]
    return [f"{value:.{DIGITS}g}" if value == value else "" for value in values.tolist()]  # noqa: PLR0124


def write_parquet_tables(folder: Path, tables: AnalysisTables, about: Mapping[str, Any]) -> list[Path]:
    """A file for each table; a column's metadata are `unit` and `description`, the file's `grabberd`.

    Raises:
        ExtraMissing: pyarrow is not installed.
        StorageError: a file cannot be written.
    """
    check_installed("parquet")
    return [_parquet(folder / f"{table.name}.parquet", table, about) for table in tables.values()]


def _parquet(path: Path, table: Table, about: Mapping[str, Any]) -> Path:
    import pyarrow as pa  # type: ignore[import-untyped]  # noqa: PLC0415
    import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415

    arrays = [pa.array(column.values) for column in table.columns]
    fields = [
        pa.field(one.name, array.type, metadata={"unit": one.unit, "description": one.meaning})
        for one, array in zip(table.columns, arrays, strict=True)
    ]
    told = {"description": table.meaning, "grabberd": json.dumps(about, ensure_ascii=False)}
    with storage_errors(path):
        pq.write_table(pa.table(arrays, pa.schema(fields, told)), path, compression="zstd")
    return path


def write_hdf5(folder: Path, tables: AnalysisTables, grid: Grid, about: Mapping[str, Any]) -> Path:
    """One file: a group for each table, a dataset for each column with `unit` and `meaning`, and the grid.

    Raises:
        ExtraMissing: h5py is not installed.
        StorageError: the file cannot be written.
    """
    check_installed("hdf5")
    import h5py  # noqa: PLC0415

    path = folder / HDF5_NAME
    with storage_errors(path), h5py.File(path, "x") as file:
        file.attrs["grabberd"] = json.dumps(about, ensure_ascii=False)
        for table in tables.values():
            _group(file, table)
        group = file.create_group("grid", track_order=True)
        group.attrs["meaning"] = "the targets; a triangle's corners are places in `target`, counted from 0"
        for name in ("target", "row", "column", "nominal_mm", "u_mm", "v_mm", "triangles"):
            group.create_dataset(name, data=getattr(grid, name))
    return path


def _group(file: "h5py.File", table: Table) -> None:
    import h5py  # noqa: PLC0415

    group = file.create_group(table.name, track_order=True)
    group.attrs["meaning"] = table.meaning
    for column in table.columns:
        words = column.values.dtype.kind == "U"
        data = column.values.astype(object) if words else column.values
        dataset = group.create_dataset(column.name, data=data, dtype=h5py.string_dtype() if words else None)
        dataset.attrs["unit"], dataset.attrs["meaning"] = column.unit, column.meaning
