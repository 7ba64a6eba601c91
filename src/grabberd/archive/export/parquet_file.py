"""Tables as Parquet, part by part; every column carries its unit and description.

pyarrow is optional, large and slow to import, so it is imported where something is written.
"""

import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from grabberd.core.chain.columns import LABELS, WORD, Column, Rows
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    import pyarrow as pa  # type: ignore[import-untyped]
    import pyarrow.parquet as pq  # type: ignore[import-untyped]


def check_parquet() -> None:
    """Checks that pyarrow is installed, without importing it.

    Raises:
        ExtraMissing: It is not.
    """
    if importlib.util.find_spec("pyarrow") is None:
        raise ExtraMissing("Parquet", "parquet")


def write_parquet(
    file: IO[bytes], columns: Sequence[Column], parts: Iterable[Rows], metadata: Mapping[str, str]
) -> int:
    """Writes a row group for each part of a table; returns the number of rows.

    Args:
        file: Open file, which need not be seekable: it may be a pipe.
        columns: Columns of the table.
        parts: Rows of the table; one part at a time is in memory.
        metadata: Metadata of the file.

    Raises:
        ExtraMissing: pyarrow is not installed.
    """
    check_parquet()
    count = 0
    with parquet_writer(file, columns, metadata) as writer:
        for rows in parts:
            batch = parquet_batch(columns, rows)
            writer.write_batch(batch)
            count += batch.num_rows
    return count


def parquet_writer(
    file: IO[bytes], columns: Sequence[Column], metadata: Mapping[str, str] | None = None
) -> "pq.ParquetWriter":
    """A writer of row groups, which is closed as a context manager."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    schema = pa.schema([_field(column) for column in columns], metadata)
    # A dictionary of measured numbers, which hardly ever repeat, takes longer than all else and is larger.
    repeating = [leaf for column in columns if not column.dtype.startswith("f") for leaf in _leaves(column)]
    return pq.ParquetWriter(
        file, schema, compression="zstd", use_dictionary=repeating, write_page_checksum=True
    )


def parquet_batch(columns: Sequence[Column], rows: Rows) -> "pa.RecordBatch":
    """One part of a table for `ParquetWriter.write_batch`."""
    import pyarrow as pa  # noqa: PLC0415

    count = len(rows[columns[0].name])
    arrays = [_array(column, rows[column.name], count) for column in columns]
    return pa.record_batch(arrays, pa.schema([_field(column) for column in columns]))


def _field(column: Column) -> "pa.Field":
    import pyarrow as pa  # noqa: PLC0415

    unit = {} if column.dtype in {WORD, LABELS} else {"unit": column.unit}
    return pa.field(column.name, _type(column), metadata={**unit, "description": column.meaning})


def _leaves(column: Column) -> list[str]:
    """Parquet's names of the values of a column: a map has keys and values below it."""
    below = (".key_value.key", ".key_value.value") if column.dtype == LABELS else ("",)
    return [column.name + one for one in below]


def _type(column: Column) -> "pa.DataType":
    import pyarrow as pa  # noqa: PLC0415

    special = {
        "U": pa.string(),
        "M8[ms]": pa.timestamp("ms", "UTC"),
        WORD: pa.dictionary(pa.int32(), pa.string()),
        LABELS: pa.map_(pa.string(), pa.string()),
    }
    return special.get(column.dtype) or pa.from_numpy_dtype(np.dtype(column.dtype))


def _array(column: Column, values: Any, count: int) -> "pa.Array":
    import pyarrow as pa  # noqa: PLC0415

    if column.dtype not in {WORD, LABELS}:
        return pa.array(values, _type(column))
    # One value for all rows: its dictionary has a single entry, so that it costs next to nothing.
    same = pa.array(np.zeros(count, np.int32))
    if column.dtype == WORD:
        return pa.DictionaryArray.from_arrays(same, pa.array([values]))
    return pa.array([list(values.items())], _type(column)).take(same)
