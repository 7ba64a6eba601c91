"""Columns and tables: the one specification behind every file format and its documentation.

Points, the tables of an analysis and data sets all consist of them. `grabberd.archive.export` has one writer
for each format, and `docs/reference/generate.py` describes the same columns.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

WORD, LABELS = "category", "map"
"""Types beyond numpy's: one word, or one mapping of words to words, that holds for all rows of a file."""

ROWS_AT_ONCE = 10_000
"""Rows per part for writers that convert a table and then hold it several times over."""

Rows = Mapping[str, Any]
"""Values by column name: (N,) arrays, or the single value of a `WORD` or `LABELS` column."""


class Column(NamedTuple):
    """One column of a table.

    Attributes:
        name: Name, which ends with the unit where there is one.
        unit: Unit; "1" for a ratio, empty for text and for numbers that count or identify.
        dtype: numpy's name of the type in files, or `WORD` or `LABELS`.
        meaning: Description for people.
        measured: True if a column `sigma_NAME` follows with the σ of this one, in the same unit.
        csv_format: Format of a float in CSV; seven digits by default, since σ starts well before the last.
    """

    name: str
    unit: str
    dtype: str
    meaning: str
    measured: bool = False
    csv_format: str = ".7g"

    @property
    def expanded(self) -> tuple["Column", ...]:
        """The column itself, and the column of its σ if it is measured."""
        if not self.measured:
            return (self,)
        sigma = Column(f"sigma_{self.name}", self.unit, self.dtype, f"σ of {self.name}")
        return (self._replace(measured=False), sigma)

    def array(self, values: Any) -> NDArray[Any]:
        """(N,) values of this column's type, text as objects.

        Floats stay floats in a column of integers: NaN is the only way to leave a value unknown. Numpy's own
        text would take as much memory in every row as the longest one does.
        """
        given = np.atleast_1d(values).ravel()
        if self.dtype == "U":
            return given.astype(object, copy=False)
        return given if given.dtype.kind == "f" else given.astype(self.dtype, copy=False)


class TableSpec(NamedTuple):
    """Specification of one table; the `key` columns identify a row."""

    meaning: str
    key: tuple[Column, ...]
    values: tuple[Column, ...]

    @property
    def columns(self) -> tuple[Column, ...]:
        """All columns in order, those of σ included."""
        return tuple(one for column in (*self.key, *self.values) for one in column.expanded)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """One table; its columns have the types of their values."""

    name: str
    meaning: str
    columns: tuple[Column, ...]
    rows: Rows

    def __len__(self) -> int:
        return len(self.rows[self.columns[0].name])

    def parts(self, size: int = ROWS_AT_ONCE) -> Iterator[Rows]:
        """The rows of the table in parts, for writers that need several times their memory."""
        for first in range(0, len(self), size):
            yield {name: values[first : first + size] for name, values in self.rows.items()}

    def column(self, name: str) -> NDArray[Any]:
        """(N,) values of one column."""
        return self.rows[name]


def make_table(name: str, spec: TableSpec, values: Mapping[str, Any]) -> Table:
    """A table from values by column name: an array, or for a measured column the pair of values and σ."""
    arrays: dict[str, NDArray[Any]] = {}
    columns = []
    for column in (*spec.key, *spec.values):
        parts = values[column.name] if column.measured else (values[column.name],)
        for one, part in zip(column.expanded, parts, strict=True):
            arrays[one.name] = one.array(part)
            columns.append(one._replace(dtype=_dtype(arrays[one.name])))
    return Table(name, spec.meaning, tuple(columns), arrays)


def _dtype(values: NDArray[Any]) -> str:
    return "U" if values.dtype.kind == "O" else values.dtype.str[1:]


def joined(columns: Sequence[Column], parts: Sequence[Rows]) -> Rows:
    """Concatenate several parts of a table."""
    return {one.name: np.concatenate([rows[one.name] for rows in parts]) for one in columns}


def regrouped(columns: Sequence[Column], parts: Iterable[Rows], least: int) -> Iterator[Rows]:
    """Parts of a table, so many joined that each has at least this many rows, but for the last."""
    some: list[Rows] = []
    for rows in parts:
        some.append(rows)
        if sum(len(one[columns[0].name]) for one in some) >= least:
            yield joined(columns, some)
            some = []
    if some:
        yield joined(columns, some)


def json_values(values: NDArray[Any]) -> list[Any]:
    """A column's values for JSON: None for a float that is unknown."""
    if values.dtype.kind != "f":
        return [*map(str, values)] if values.dtype.kind == "O" else values.tolist()
    shown = values.astype(object)
    shown[~np.isfinite(values)] = None
    return list(shown.tolist())
