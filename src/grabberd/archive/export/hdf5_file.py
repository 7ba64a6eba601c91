"""Tables as HDF5: a group for each, and in it a plain array for each column with its unit and meaning."""

import importlib.util
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from grabberd.core.chain.columns import Table
from grabberd.errors import ExtraMissing
from grabberd.files.disk import storage_errors

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
    import h5py  # noqa: PLC0415

    group = _group(file, table.name, table.meaning)
    for column in table.columns:
        values = table.column(column.name)
        # Variable-length strings are read by every HDF5 library.
        if column.dtype == "U":
            dataset = group.create_dataset(column.name, data=values, dtype=h5py.string_dtype())
        else:
            dataset = group.create_dataset(column.name, data=values)
        dataset.attrs["unit"], dataset.attrs["meaning"] = column.unit, column.meaning


def _group(file: "h5py.File", name: str, meaning: str) -> "h5py.Group":
    # Without tracked order, readers would list the columns by the alphabet.
    group = file.create_group(name, track_order=True)
    group.attrs["meaning"] = meaning
    return group
