"""Tables whose columns know their units, and the points of a run as one, and over fields and targets.

They are numpy arrays, and data frames where pandas is installed.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import END
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.point_grid import GridTargets, known_model
from grabberd.archive.export.points_columns import POINT_COLUMNS, rows_by_group
from grabberd.archive.export.points_export import points_about
from grabberd.core.chain.columns import LABELS, WORD, Column, joined
from grabberd.errors import ExtraMissing, InputError, NotFound

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


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
        return self.array[column]

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


def optional(module: str, what: str) -> Any:
    """A module of an optional dependency.

    Args:
        module: Its name.
        what: What it is needed for.

    Raises:
        ExtraMissing: It is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise ExtraMissing(what, EXTRA) from error


_BY_FIELD = ("n", "time_utc", "time_s")
_BY_TARGET = "target"


@dataclass(frozen=True, slots=True)
class Chosen:
    """Choice of the points that are read.

    Attributes:
        run: Number of the run; None for the newest.
        first_n: Number of the first field.
        end_n: Number after the last field; None for all that follow.
        every: 2 for every second field, and so on.
    """

    run: int | None = None
    first_n: int = 0
    end_n: int | None = None
    every: int = 1


class PointTable(Table):
    """Points with their σ: a row for each target that was found in each field.

    Columns, units and meanings are those of `points.csv`: docs/reference/points.md.

    Attributes:
        about: Capture, run, calibration, version, verdict and labels.
        targets: The targets of the object model, and their nominal positions.
    """

    def __init__(self, rows: Mapping[str, Any], about: Mapping[str, Any], targets: GridTargets) -> None:
        super().__init__(POINT_COLUMNS, rows)
        self.about = dict(about)
        self.targets = targets

    def to_dataframe(self) -> Any:
        """The table as a pandas DataFrame; its `attrs` have `units`, and `about` the capture and run.

        Raises:
            ExtraMissing: pandas is not installed.
        """
        frame = super().to_dataframe()
        frame.attrs["about"] = self.about
        return frame

    def to_xarray(self) -> "xr.Dataset":
        """The points over the dimensions `n` and `target`; NaN where a target was not found.

        Lost fields are absent from `n`. Coordinates are `time_s` and `time_utc` of each field,
        `row`, `column` and `nominal_x_mm` … of each target; each variable has `units` and `long_name`. The
        attribute `grabberd` is `about` as JSON.

        Raises:
            ExtraMissing: xarray is not installed.
        """
        xarray = optional("xarray", "an xarray Dataset")
        n, first, field = np.unique(self.array["n"], return_index=True, return_inverse=True)
        place = np.searchsorted(self.targets.target, self.array[_BY_TARGET])
        shape = (len(n), len(self.targets))
        variables: dict[str, Any] = {}
        for name in self.units:
            if name in {*_BY_FIELD, _BY_TARGET}:
                continue
            values = np.full(shape, np.nan, self.array.dtype[name])
            values[field, place] = self.array[name]
            variables[name] = (("n", _BY_TARGET), values, self._attributes(name))
        # As text: netCDF and zarr take no mappings as attributes.
        about = json.dumps(self.about, ensure_ascii=False)
        nominal = {
            f"nominal_{axis}_mm": (_BY_TARGET, self.targets.nominal_mm[:, i], {"units": "mm"})
            for i, axis in enumerate("xyz")
        }
        coordinates = {
            "n": ("n", n, self._attributes("n")),
            "time_s": ("n", self.array["time_s"][first], self._attributes("time_s")),
            "time_utc": ("n", self.array["time_utc"][first].astype("M8[ns]"), self._attributes("time_utc")),
            "target": (_BY_TARGET, self.targets.target, self._attributes("target")),
            "row": (_BY_TARGET, self.targets.row),
            "column": (_BY_TARGET, self.targets.column),
            **nominal,
        }
        return xarray.Dataset(variables, coordinates, {"grabberd": about})

    def _attributes(self, name: str) -> dict[str, str]:
        unit = {"units": self.units[name]} if self.units[name] else {}
        return {**unit, "long_name": self.meanings[name]}


def read_points(reader: CaptureReader, chosen: Chosen) -> PointTable:
    """The chosen points of a capture.

    Raises:
        InputError: `every` is less than 1.
        NotFound: The run does not exist, or none of these fields has points.
        CaptureFileError: They are damaged.
    """
    if chosen.every < 1:
        raise InputError(f"every is {chosen.every}, not 1 or more", "every=2 gives every second field")
    run = reader.run(chosen.run)
    end_n = END if chosen.end_n is None else chosen.end_n
    reader.check_points(run.run, chosen.first_n, end_n)
    parts = rows_by_group(reader, run.run, chosen.first_n, end_n, chosen.every)
    some = [rows for rows in parts if len(rows["n"])]
    if not some:
        raise NotFound(
            f"run {run.run} of capture {reader.meta.id} has no points in the fields that were asked for",
            "its fields are numbered from 0 on; capture.ledger says which did not come",
        )
    rows = joined(POINT_COLUMNS, some)
    targets = GridTargets.of(known_model(run), np.unique(rows["target"]).astype(np.int64))
    return PointTable(rows, points_about(reader, run.run), targets)
