"""A table of a document, read by columns."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.reports.notation import DASH, fixed, measured


class Spread(NamedTuple):
    """The range of a column's known values; `sigma` is the median of their σ, None where there is none."""

    least: float
    median: float
    greatest: float
    sigma: float | None


class Columns:
    """The columns of a table; numbers that are not known are NaN."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        self._columns = {column["name"]: column for column in table["columns"]}

    def __len__(self) -> int:
        return max((len(column["values"]) for column in self._columns.values()), default=0)

    def numbers(self, name: str) -> Array:
        """(R,) values of a column; all NaN where the table has no such column."""
        values = self._columns[name]["values"] if name in self._columns else [None] * len(self)
        return np.array(values, dtype=np.float64)

    def sigma(self, name: str) -> Array:
        """(R,) σ of a column's values, in the column's unit."""
        return self.numbers(f"sigma_{name}")

    def words(self, name: str) -> list[str]:
        """R values of a text column; empty where the table has no such column."""
        return list(self._columns[name]["values"]) if name in self._columns else [""] * len(self)

    def unit(self, name: str) -> str:
        """Unit of a column as it is written; empty for pure numbers."""
        unit = str(self._columns[name]["unit"]) if name in self._columns else ""
        return "" if unit == "1" else unit

    def titled(self, name: str, title: str) -> str:
        """A column's title with its unit in brackets."""
        return f"{title} [{self.unit(name)}]" if self.unit(name) else title

    def is_known(self, name: str) -> bool:
        """True if any of the column's values is known."""
        return bool(np.isfinite(self.numbers(name)).any())

    def value(self, name: str, row: int = 0) -> float | None:
        """A single value; None where it is not known."""
        value = self.numbers(name)[row] if len(self) else np.nan
        return float(value) if np.isfinite(value) else None

    def values(self, name: str) -> list[float | None]:
        """R values of a column; None where they are not known."""
        return [float(value) if np.isfinite(value) else None for value in self.numbers(name)]

    def cell(self, name: str, row: int = 0, decimals: int = 3) -> str:
        """A value with its σ in brackets; one without σ with a fixed number of decimals."""
        return self.cells(name, decimals)[row] if len(self) else DASH

    def cells(self, name: str, decimals: int = 3) -> list[str]:
        """R values of a column, written as `cell` does."""
        pairs = zip(self.values(name), self.values(f"sigma_{name}"), strict=True)
        return [_cell(value, sigma, decimals) for value, sigma in pairs]

    def estimate(self, name: str, decimals: int = 3) -> str:
        """The first row's value with ± σ and its unit, for running text."""
        value, sigma, unit = self.value(name), self.value(f"sigma_{name}"), self.unit(name)
        if value is None:
            return DASH
        if not sigma:
            return f"{fixed(value, decimals)} {unit}".strip()
        return "{} ± {} {}".format(*measured(value, sigma), unit).strip()

    def spread(self, name: str) -> Spread:
        """Range of the known values of a column that has any."""
        values, sigma = self.numbers(name), self.sigma(name)
        known = float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else None
        return Spread(float(np.nanmin(values)), float(np.nanmedian(values)), float(np.nanmax(values)), known)


def _cell(value: float | None, sigma: float | None, decimals: int) -> str:
    if value is None:
        return DASH
    if sigma is None:
        return fixed(value, decimals)
    return "{} ({})".format(*measured(value, sigma))
