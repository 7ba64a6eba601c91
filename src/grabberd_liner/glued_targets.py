"""Errors of pressure and load with more columns or rows of targets, for before they are glued.

The errors are those of closed walls that were solved as solids, by a program that shares nothing with the
analysis: of single fields of 8 bit, both views seeing every target. This command writes their table:

    python -m tests.proofs.bench.load_accuracy --held-out --glued src/grabberd_liner/glued_targets.csv
"""

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AnalysisError
from grabberd.extension import Advice
from grabberd_liner.analysis.grid import Grid

TABLE = "glued_targets.csv"
TITLE = "What more columns or rows of targets give for pressure and load"
HEADS = (
    "Columns",
    "Rows apart [mm]",
    "Error of the mean pressure [kPa]",
    "of the compression [kPa]",
    "of the load per height [%]",
)
_SAME_PITCH = 0.15
"""Share by which rows may be nearer or farther apart than those of the table, to be taken for the same."""


class GluedTargets(NamedTuple):
    """A grid of targets, and root mean square errors with it.

    Attributes:
        columns: their number; `row_pitch_mm`: distance of the rows.
        walls: that gave an answer.
        mean_kpa: error of the mean contact pressure over the targets; `compression_kpa`: of that over the
            teat's middle; `load_percent`: of the force per height, as a share of that force.
    """

    columns: int
    row_pitch_mm: float
    walls: int
    mean_kpa: float
    compression_kpa: float
    load_percent: float

    @property
    def cells(self) -> tuple[str, ...]:
        """The same as text, by `HEADS`."""
        errors = (f"{self.mean_kpa:.2f}", f"{self.compression_kpa:.2f}", f"{self.load_percent:.1f}")
        return (str(self.columns), f"{self.row_pitch_mm:g}", *errors)


@cache
def glued_targets() -> tuple[GluedTargets, ...]:
    """The table, the fewest columns first."""
    _, *lines = files(__package__).joinpath(TABLE).read_text(encoding="ascii").splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    return tuple(
        GluedTargets(int(columns), pitch, int(walls), *errors) for columns, pitch, walls, *errors in rows
    )


def own_grid(columns: int, row_pitch_mm: float) -> GluedTargets | None:
    """The grid of the table that is like one of so many columns; None if there is none."""
    alike = (one for one in glued_targets() if one.columns == columns)
    return next((one for one in alike if abs(row_pitch_mm / one.row_pitch_mm - 1) < _SAME_PITCH), None)


def note() -> str:
    """The walls and fields that the figures are of."""
    walls = " or ".join(map(str, sorted({one.walls for one in glued_targets()})))
    return (
        f"Root mean square errors on {walls} closed walls that were solved independently; single fields of 8 "
        "bit, all targets in view. Most of the walls are alike at all heights, so rows count for less here "
        "than near a teat's end."
    )


def advice(model: ObjectModel | None) -> Advice:
    """The table for `grabberd plan`, with the grid of the object model marked."""
    own = None
    if model is not None:
        try:
            grid = Grid.of(model)
            own = own_grid(int(np.ptp(grid.column)) + 1, grid.u_pitch_mm)
        except AnalysisError:
            own = None  # an object that is no liner's grid
    rows = [(*one.cells, "as it is" if one == own else "") for one in glued_targets()]
    return Advice(TITLE, (*HEADS, ""), rows, note(), [one._asdict() for one in glued_targets()])
