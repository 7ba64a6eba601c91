"""Tables whose columns know their units: numpy arrays, and data frames where pandas is installed."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import LABELS, WORD, Column
from grabberd.errors import ExtraMissing, InputError

if TYPE_CHECKING:
    import pandas as pd

EXTRA = "notebook"
_SHOWN = 10


class Table:
    """A table as a structured array; each column has a unit and a meaning.

    `table["x_mm"]` is a column, `numpy.asarray(table)` the structured array, `len(table)` the number of rows.

    Attributes:
        array: (N,) structured array with a field for each column.
        units: Unit by column; "1" for a ratio, "" for text and for numbers that count or identify.
        meanings: Meaning by column, in words.
    """

    def __init__(self, columns: Sequence[Column], rows: Mapping[str, Any]) -> None:
        shown = [one for one in columns if one.dtype not in {WORD, LABELS}]
        values = [np.asarray(rows[one.name]) for one in shown]
        kinds = [(one.name, value.dtype) for one, value in zip(shown, values, strict=True)]
        self.array = np.empty(len(values[0]), kinds)
        for one, value in zip(shown, values, strict=True):
            self.array[one.name] = value
        self.units = {one.name: one.unit for one in shown}
        self.meanings = {one.name: one.meaning for one in shown}

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """(N,) values of a column.

        Raises:
            InputError: There is no such column.
        """
        if column not in self.units:
            raise InputError(f"there is no column {column!r}", f"the columns are {', '.join(self.units)}")
        values: NDArray[Any] = self.array[column]
        return values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.array, dtype, copy=copy)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self)} rows of {', '.join(self.units)}>"

    def to_dataframe(self) -> "pd.DataFrame":
        """The table as a pandas DataFrame; `frame.attrs["units"]` has the units.

        Raises:
            ExtraMissing: pandas is not installed.
        """
        pandas = optional("pandas", "a data frame")
        frame: pd.DataFrame = pandas.DataFrame({name: self.array[name] for name in self.units})
        frame.attrs["units"] = dict(self.units)
        return frame

    def _repr_html_(self) -> str | None:
        """The first and last rows, as notebooks show a data frame; None without pandas."""
        try:
            return self.to_dataframe().to_html(max_rows=_SHOWN)
        except ExtraMissing:
            return None


def optional(module: str, what: str, extra: str = EXTRA) -> Any:
    """A module of an optional dependency.

    Args:
        module: Its name.
        what: What it is needed for.
        extra: The extra that installs it.

    Raises:
        ExtraMissing: It is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise ExtraMissing(what, extra) from error
