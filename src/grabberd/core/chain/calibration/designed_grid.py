"""Design of a calibration frame or an object: a grid of targets, with steps in depth that make it unique."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.adjustment.normal_equations import check_depth
from grabberd.core.calibration.calibration_frame import MOST_EXAMINED, targets_to_add, undecided
from grabberd.core.calibration.identification.frame_identification import IdentificationSettings
from grabberd.core.geometry import PARAMETERS
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import InputError, RankDeficient

MOST_TARGETS = 1000
_DIGITS = 4


class Along(StrEnum):
    """Targets that share a depth: none (each has its own), those of a row, or those of a column."""

    TARGETS = "targets"
    ROWS = "rows"
    COLUMNS = "columns"


@dataclass(frozen=True, slots=True)
class GridDesign:
    """Dimensions of a grid of targets.

    Attributes:
        name: Name of the calibration frame or object.
        rows: Number of rows, which follow one another along X.
        columns: Number of columns, along Y.
        pitch_mm: Distance from column to column, and from row to row.
        row_pitch_mm: Distance from row to row, if it is another.
        diameter_mm: Diameter of the targets.
        depth_mm: From the lowest target to the highest, along Z; 0 for a plane.
        depth_steps: Number of depths, equally far apart.
        along: Targets that share a depth.
        sigma_mm: Standard deviation of the places, in each coordinate.
    """

    name: str
    rows: int
    columns: int
    pitch_mm: float
    row_pitch_mm: float | None = None
    diameter_mm: float = 1.5
    depth_mm: float = 0.0
    depth_steps: int = 5
    along: Along = Along.TARGETS
    sigma_mm: float = 0.01


def designed_grid(design: GridDesign) -> ObjectModel:
    """Lay out the targets, ids from 1 row by row, the middle of the grid at the origin.

    Depths follow one another irregularly, so that the grid is not periodic.

    Raises:
        InputError: A dimension is out of range, or targets overlap.
    """
    _check(design)
    row, column = (axis.ravel() for axis in np.indices((design.rows, design.columns)))
    x_mm = (row - (design.rows - 1) / 2) * (design.row_pitch_mm or design.pitch_mm)
    y_mm = (column - (design.columns - 1) / 2) * design.pitch_mm
    z_mm = _depths(design, row, column)
    return ObjectModel(
        name=design.name,
        target=np.arange(1, len(row) + 1, dtype=np.int32),
        # Adding zero turns −0.0 into 0.0, which would otherwise be written with its sign.
        xyz_mm=np.column_stack([x_mm, y_mm, z_mm]).round(_DIGITS) + 0.0,
        row=row.astype(np.int32),
        column=column.astype(np.int32),
        target_diameter_mm=design.diameter_mm,
        sigma_mm=design.sigma_mm,
    )


def calibration_frame_remarks(model: ObjectModel) -> Iterator[str]:
    """Yield why calibration will refuse a calibration frame or ask about it: too few targets, a plane,
    symmetries.
    """
    criteria = IdentificationSettings()
    if len(model) < criteria.least_targets:
        yield f"it has {len(model)} targets, and calibration needs {criteria.least_targets} in each view"
        return
    try:
        check_depth(model.xyz_mm, PARAMETERS[:3], "its targets")
    except RankDeficient as error:
        yield f"calibration refuses it: {error.message}; {error.hint}"
        return
    if len(model) > MOST_EXAMINED:
        yield f"it has more than {MOST_EXAMINED} targets: whether it can be told from itself was not examined"
    elif alike := undecided(model, criteria.margin):
        places = ", ".join(
            "({:.1f}, {:.1f}, {:.1f})".format(*one) for one in targets_to_add(model, criteria.margin)
        )
        yield (
            f"it cannot be told from itself: {'; '.join(dict.fromkeys(map(str, alike)))}; each calibration "
            "will ask how it stands, unless each target has a depth of its own or there is a further one at "
            f"{places} mm"
        )


def _check(design: GridDesign) -> None:
    closest_mm = min(design.pitch_mm, design.row_pitch_mm or design.pitch_mm)
    sizes = (closest_mm, design.diameter_mm, design.depth_mm, design.sigma_mm)
    conditions = {
        f"rows {design.rows} and columns {design.columns} are not above 0": min(design.rows, design.columns)
        > 0,
        f"{design.rows * design.columns} targets are more than {MOST_TARGETS}": design.rows * design.columns
        <= MOST_TARGETS,
        "pitch, diameter, depth and sigma are not all finite": all(map(math.isfinite, sizes)),
        f"diameter {design.diameter_mm:g} mm is not above 0": design.diameter_mm > 0,
        f"targets of {design.diameter_mm:g} mm overlap at a pitch of {closest_mm:g} mm": closest_mm
        > design.diameter_mm,
        f"depth {design.depth_mm:g} mm is below 0": design.depth_mm >= 0,
        f"{design.depth_steps} steps make no depth": design.depth_steps >= 2,
        f"sigma {design.sigma_mm:g} mm is below 0": design.sigma_mm >= 0,
    }
    if wrong := [problem for problem, holds in conditions.items() if not holds]:
        raise InputError("; ".join(wrong), "12 rows and 9 columns at a pitch of 6.5 mm are the paper's")


def _depths(design: GridDesign, row: Indices, column: Indices) -> Array:
    """(N,) depths of the targets."""
    heights_mm = np.linspace(-design.depth_mm / 2, design.depth_mm / 2, design.depth_steps)
    rows = 1 if design.along is Along.COLUMNS else design.rows
    columns = 1 if design.along is Along.ROWS else design.columns
    steps = _irregular_steps(rows, columns, design.depth_steps)
    return heights_mm[np.broadcast_to(steps, (design.rows, design.columns))[row, column]]


def _irregular_steps(rows: int, columns: int, steps: int) -> Indices:
    """(rows, columns) steps, each about equally often, without a period; the same for the same numbers.

    Neighbours in a row differ by half of the depth at most: they are beside one another along the base, and
    one view sees them closer together the more they differ.
    """
    rng, used = np.random.default_rng(rows * columns), np.zeros(steps)
    dealt, reach = np.zeros((rows, columns), np.intp), max((steps - 1) // 2, 1)
    for row, column in np.ndindex(rows, columns):
        away = np.abs(np.arange(steps) - dealt[row, column - 1]) if column else np.zeros(steps)
        rank = used + rng.uniform(0, 2, steps)
        chosen = int(np.where(away <= reach, rank, np.inf).argmin())
        dealt[row, column] = chosen
        used[chosen] += 1
    return dealt
