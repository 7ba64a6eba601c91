"""The points of a run on a grid of fields and targets, for formats that have no row for each point."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.digests import Damage
from grabberd.archive.capture.meta import SEALED
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.export.points_columns import rows_by_group
from grabberd.archive.export.points_export import open_run
from grabberd.core.chain.columns import Rows
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class GridTargets:
    """The T targets of a grid, by ascending id: those of the object model, and any other that has a point.

    Attributes:
        target: (T,) int64, their ids.
        row: (T,) float64, row on the target grid; NaN where it is unknown.
        column: (T,) float64, column on the target grid.
        nominal_mm: (T, 3) float64, nominal positions.
    """

    target: NDArray[np.int64]
    row: NDArray[np.float64]
    column: NDArray[np.float64]
    nominal_mm: NDArray[np.float64]

    @classmethod
    def of(cls, model: ObjectModel | None, seen: NDArray[np.int64]) -> "GridTargets":
        """Those of a model, or of none, and those that were seen."""
        known = np.empty(0, np.int64) if model is None else model.target.astype(np.int64)
        target = np.union1d(known, seen)
        unknown = np.full((len(target), 5), np.nan)
        if model is not None:
            places = np.searchsorted(target, known)
            unknown[places] = np.column_stack([model.row, model.column, model.xyz_mm])
        return cls(target, unknown[:, 0], unknown[:, 1], unknown[:, 2:])

    def __len__(self) -> int:
        return len(self.target)


class _Survey(NamedTuple):
    """Targets that have points, the number of points, and their greatest coordinate and σ."""

    seen: NDArray[np.int64]
    points: int
    reach_mm: float
    sigma_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class PointGrid:
    """The points of a run by field and target; lost fields and targets that were not found have their cells.

    Attributes:
        reader: The capture.
        run: The run.
        first_n: Number of the first field.
        fields: Number of fields, lost ones included.
        targets: The targets.
        points: Number of points; all other cells are empty.
        reach_mm: Greatest coordinate.
        sigma_mm: Greatest σ of a position.
    """

    reader: CaptureReader
    run: RunInfo
    first_n: int
    fields: int
    targets: GridTargets
    points: int
    reach_mm: float
    sigma_mm: float

    @classmethod
    def open(cls, path: Path, run: int | None, left_out: list[Damage] | None = None) -> "PointGrid":
        """Opens a capture and looks its points through; arguments and errors are those of `open_run`."""
        reader, number = open_run(path, run, left_out)
        try:
            first_n = reader.first_n or 0
            end_n = _end_n(reader, number)
            missing = 0 if left_out is None else len(left_out)
            survey = _survey(reader, number, first_n, end_n)
            if left_out is not None:
                del left_out[missing:]  # damaged ones come again
            info = reader.run(number)
            targets = GridTargets.of(known_model(info), survey.seen)
        except Exception:
            reader.close()
            raise
        return cls(reader, info, first_n, max(end_n - first_n, 0), targets, *survey[1:])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.reader.close()

    def parts(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], Rows]]:
        """Points of some fields at a time: indices of their fields, of their targets, and their rows."""
        end_n = self.first_n + self.fields
        for rows in rows_by_group(self.reader, self.run.run, self.first_n, end_n):
            fields = np.asarray(rows["n"], np.int64) - self.first_n
            places = np.asarray(np.searchsorted(self.targets.target, rows["target"]), np.int64)
            yield fields, places, rows


def position_sigma_mm(rows: Rows) -> NDArray[np.float64]:
    """(N,) σ of each position from pointing and line jitter: the root of the sum over the three axes."""
    squares = sum(rows[f"sigma_{axis}_mm"].astype(np.float64) ** 2 for axis in "xyz")
    return np.asarray(np.sqrt(squares), np.float64)


def _end_n(reader: CaptureReader, run: int) -> int:
    """The number after the last field; of a capture that is being written, after the last that has points."""
    last = reader.last_field
    _, end_n = reader.point_span(run)
    # Fields without points follow below the end that was read first, so that both passes see the same.
    return end_n if reader.meta.state != SEALED or last is None else max(end_n, last[0] + 1)


def _survey(reader: CaptureReader, run: int, first_n: int, end_n: int) -> _Survey:
    seen, points, reach_mm, sigma_mm = np.empty(0, np.int64), 0, 0.0, 0.0
    for rows in rows_by_group(reader, run, first_n, end_n):
        seen = np.union1d(seen, rows["target"].astype(np.int64))
        points += len(rows["n"])
        reach_mm = max(reach_mm, *(float(np.abs(rows[f"{axis}_mm"]).max(initial=0.0)) for axis in "xyz"))
        sigma_mm = max(sigma_mm, float(position_sigma_mm(rows).max(initial=0.0)))
    return _Survey(seen, points, reach_mm, sigma_mm)


def known_model(info: RunInfo) -> ObjectModel | None:
    """The object model of a run; points need none, so a run without one has targets without a place in it."""
    try:
        return ObjectModel.from_document(info.made_with["object"] or {})
    except InputError:
        return None
