"""The points of a run as a table, and over fields and targets."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.archive import CaptureReader
from grabberd.archive.capture.checked_rows import END
from grabberd.archive.export.point_grid import GridTargets, known_model
from grabberd.archive.export.points_columns import POINT_COLUMNS, rows_by_group
from grabberd.archive.export.points_export import points_about
from grabberd.core.chain.columns import Rows
from grabberd.errors import InputError, NotFound
from grabberd.library.table import Table, optional

if TYPE_CHECKING:
    import xarray as xr

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
        dataset: xr.Dataset = xarray.Dataset(variables, coordinates, {"grabberd": about})
        return dataset

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
    rows = _joined(rows_by_group(reader, run.run, chosen.first_n, end_n, chosen.every))
    if rows is None:
        raise NotFound(
            f"run {run.run} of capture {reader.meta.id} has no points in the fields that were asked for",
            "its fields are numbered from 0 on; capture.ledger says which did not come",
        )
    targets = GridTargets.of(known_model(run), np.unique(rows["target"]).astype(np.int64))
    return PointTable(rows, points_about(reader, run.run), targets)


def _joined(parts: Iterable[Rows]) -> Rows | None:
    some = [one for one in parts if len(one["n"])]
    if not some:
        return None
    return {one.name: np.concatenate([rows[one.name] for rows in some]) for one in POINT_COLUMNS}
