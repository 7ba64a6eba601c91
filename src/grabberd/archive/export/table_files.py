"""Tables as CSV (RFC 4180), as vertices of a PLY file and as Parquet, part by part.

Spreadsheet programs take a text that begins with one of a few characters for a formula, and run it. Labels,
notes and reasons come from outside, so in CSV such a text gets an apostrophe in front; numbers do not.
PLY is binary and little-endian, with or without triangles. In Parquet every column carries its unit and
description; pyarrow is optional, large and slow to import, so it is imported where something is written.
"""

import csv
import importlib.util
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import LABELS, WORD, Column, Rows
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    import pyarrow as pa  # type: ignore[import-untyped]
    import pyarrow.parquet as pq  # type: ignore[import-untyped]


FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of texts that a spreadsheet program would run."""
PLY_TYPES = {"i4": "int", "i8": "int", "f4": "float", "f8": "double"}
"""PLY's name of a column's type; it has no integers of 64 bits."""
PLY_NAMES = {"x_mm": "x", "y_mm": "y", "z_mm": "z"}
"""The names that programs look for when they draw vertices."""
_NUMPY = {"int": "<i4", "float": "<f4", "double": "<f8"}
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def cell(text: str) -> str:
    """A text as a cell that is text in every program."""
    return f"'{text}" if text.startswith(FORMULA) else text


def cells(row: Iterable[object]) -> list[object]:
    """A row of texts and numbers, its texts as such cells."""
    return [cell(one) if isinstance(one, str) else one for one in row]


class CsvDialect(NamedTuple):
    """Signs of a CSV file.

    Attributes:
        separator: Separator of its cells.
        decimal: Decimal sign of its numbers.
        mark: Text at its beginning.
    """

    separator: str
    decimal: str
    mark: str


COMMAS = CsvDialect(",", ".", "")
# Without the byte order mark, a spreadsheet program takes UTF-8 for the encoding of its country.
SEMICOLONS = CsvDialect(";", ",", "\ufeff")
"""For spreadsheet programs in languages with decimal commas."""
DIALECTS = {"comma": COMMAS, "semicolon": SEMICOLONS}


def csv_text(columns: Sequence[Column], parts: Iterable[Rows], dialect: CsvDialect = COMMAS) -> Iterator[str]:
    """Text of a CSV file: the head, then the rows of each part; unknown values are empty."""
    yield dialect.mark + csv_lines([[column.name for column in columns]], dialect)
    for rows in parts:
        texts = (_texts(column, rows[column.name].tolist(), dialect) for column in columns)
        yield csv_lines(zip(*texts, strict=True), dialect)


def write_csv(file: IO[bytes], texts: Iterable[str]) -> int:
    """Writes the texts of `csv_text` into an open file; returns the number of rows."""
    lines = 0
    for text in texts:
        file.write(text.encode())
        lines += text.count("\n")
    return lines - 1  # the head


def csv_lines(rows: Iterable[Iterable[object]], dialect: CsvDialect = COMMAS) -> str:
    """Rows of texts and whole numbers as text."""
    text = io.StringIO()
    csv.writer(text, delimiter=dialect.separator).writerows(rows)
    return text.getvalue()


def _texts(column: Column, values: list[Any], dialect: CsvDialect) -> list[str]:
    kind = column.dtype[0]
    if kind == "M":
        return ["" if one is None else f"{one.isoformat(timespec='milliseconds')}Z" for one in values]
    if kind == "f":
        numbers = [format(one, column.csv_format) if one == one else "" for one in values]  # noqa: PLR0124 - NaN
        return numbers if dialect.decimal == "." else [one.replace(".", dialect.decimal) for one in numbers]
    if kind == "U":
        return [cell(str(one)) for one in values]
    return [str(one) for one in values]


def ply_head(
    columns: Sequence[Column], vertices: int, comments: Sequence[str], triangles: int | None = None
) -> bytes:
    """The head of a file; `triangles` is their number in a mesh, None for a cloud."""
    faces = (f"element face {triangles}", "property list uchar int vertex_indices")
    lines = (
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {text}" for text in comments),
        f"element vertex {vertices}",
        *(f"property {PLY_TYPES[one.dtype]} {PLY_NAMES.get(one.name, one.name)}" for one in columns),
        *(faces if triangles is not None else ()),
        "end_header\n",
    )
    return "\n".join(lines).encode("ascii", "replace")


def ply_vertex(columns: Sequence[Column]) -> np.dtype[np.void]:
    """The type of one vertex."""
    return np.dtype([(column.name, _NUMPY[PLY_TYPES[column.dtype]]) for column in columns])


def ply_vertices(columns: Sequence[Column], rows: Rows) -> bytes:
    """The vertices of one part of a table."""
    vertices = np.empty(len(rows[columns[0].name]), ply_vertex(columns))
    for column in columns:
        vertices[column.name] = rows[column.name]
    return vertices.tobytes()


def ply_triangles(triangles: NDArray[Any]) -> bytes:
    """The triangles of a mesh, (K, 3) indices of vertices."""
    faces = np.empty(len(triangles), _FACE)
    faces["count"], faces["corners"] = 3, triangles
    return faces.tobytes()


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
