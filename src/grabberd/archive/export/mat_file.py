"""Tables and arrays as MAT-files of version 5, which MATLAB, Octave, Julia and R open.

scipy.io is slow to import, so it is imported where something is written.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Column, Table
from grabberd.errors import InputError

MOST_BYTES = (1 << 31) - (1 << 20)
"""Bytes of a variable: MATLAB reads 2 GiB of this version; the rest is for names and tags."""
LONGEST_NAME = 63
"""Characters of a name of a variable or of a field of one."""

_CELL_BYTES = 64
"""Bytes of a cell beside its text."""

Struct = Mapping[str, Any]
"""Fields of a variable by name: arrays, texts, numbers, lists, mappings, None or further structs of them."""


def write_mat(file: IO[bytes], variables: Mapping[str, Struct]) -> None:
    """Writes structs into an open, seekable file.

    Args:
        file: The file.
        variables: Structs by name, their values as `mat_column` and `mat_value` make them.

    Raises:
        InputError: One is larger than the format, or MATLAB, takes it.
    """
    from scipy.io import savemat  # noqa: PLC0415

    for name, struct in variables.items():
        check_size(name, _bytes(struct), MOST_BYTES, "csv, parquet and hdf5 have no such limit")
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
