"""A table of a document, by its columns."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.reports.numbers import UNKNOWN, fixed, measured

Array = NDArray[np.float64]


class Columns:
    """The columns of a table; numbers that are not known are NaN."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        self._columns = {column["name"]: column for column in table["columns"]}

    def __len__(self) -> int:
        return max((len(column["values"]) for column in self._columns.values()), default=0)

    def numbers(self, name: str) -> Array:
        """(R,) of a column; all NaN where the table has none of that name."""
        values = self._columns[name]["values"] if name in self._columns else [None] * len(self)
        return np.array(values, dtype=np.float64)

    def sigma(self, name: str) -> Array:
        """(R,) σ of a column."""
        return self.numbers(f"sigma_{name}")

    def words(self, name: str) -> list[str]:
        """(R,) of a column of words."""
        return list(self._columns[name]["values"]) if name in self._columns else [""] * len(self)

    def unit(self, name: str) -> str:
        """Of a column, as it is written; empty where it has none."""
        unit = str(self._columns[name]["unit"]) if name in self._columns else ""
        return "" if unit == "1" else unit

    def titled(self, name: str, title: str) -> str:
        """A column's title with its unit in brackets."""
        return f"{title} [{self.unit(name)}]" if self.unit(name) else title

    def is_known(self, name: str) -> bool:
        """Whether any of its values is known."""
        return bool(np.isfinite(self.numbers(name)).any())

    def one(self, name: str, row: int = 0) -> float | None:
        """A single value; None where it is not known."""
        value = self.numbers(name)[row] if len(self) else np.nan
        return float(value) if np.isfinite(value) else None

    def cell(self, name: str, row: int, places: int = 3) -> str:
        """A value with its σ in brackets; without σ to so many places."""
        value, sigma = self.one(name, row), self.one(f"sigma_{name}", row)
        if value is None:
            return UNKNOWN
        if sigma is None:
            return fixed(value, places)
        return "{} ({})".format(*measured(value, sigma))

    def said(self, name: str, places: int = 3) -> str:
        """The first row's value with σ and unit, as a sentence has it."""
        value, sigma, unit = self.one(name), self.one(f"sigma_{name}"), self.unit(name)
        if value is None:
            return UNKNOWN
        if not sigma:
            return f"{fixed(value, places)} {unit}".strip()
        return "{} ± {} {}".format(*measured(value, sigma), unit).strip()
