"""Shapes of components: size, extent and centre summed up from their runs (paper eqs. 1 and 2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling.mask import run_greys
from grabberd.core.measurement.labelling.runs import Runs


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """N components in the field's own rows and columns.

    Attributes:
        pixels: (N,) int64, number of set pixels.
        first_row, last_row: (N,) int64, vertical extent.
        first_column, last_column: (N,) int64, horizontal extent.
    """

    pixels: NDArray[np.int64]
    first_row: NDArray[np.int64]
    last_row: NDArray[np.int64]
    first_column: NDArray[np.int64]
    last_column: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pixels)

    def touch_border(self, rows: int, columns: int) -> NDArray[np.bool_]:
        """(N,) bool: True for components that touch the edge of a field of this size."""
        across: NDArray[np.bool_] = (self.first_row == 0) | (self.last_row == rows - 1)
        along: NDArray[np.bool_] = (self.first_column == 0) | (self.last_column == columns - 1)
        return across | along


def shapes_of(runs: Runs, label: NDArray[np.int64], count: int) -> Shapes:
    """Compute size and extent of every component from runs ordered by component, row and column."""
    end = np.cumsum(np.bincount(label, minlength=count))
    begin = np.append(0, end[:-1])[:count]
    return Shapes(
        pixels=np.add.reduceat(runs.last - runs.first + 1, begin),
        first_row=runs.row[begin],
        last_row=runs.row[end - 1],
        first_column=np.minimum.reduceat(runs.first, begin),
        last_column=np.maximum.reduceat(runs.last, begin),
    )


def binary_centres(runs: Runs, label: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """(N, 2) float64 column and row of each component's centre, all pixels weighted equally."""
    length = runs.last - runs.first + 1
    total = np.bincount(label, length, count)
    centres = np.empty((count, 2))
    centres[:, 0] = np.bincount(label, length * (runs.first + runs.last), count) / (2 * total)
    centres[:, 1] = np.bincount(label, length * runs.row, count) / total
    return centres


def grey_centres(
    packed: PackedField, runs: Runs, label: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute centres weighted with the grey value above the threshold, and the sum of these weights.

    Returns:
        (N, 2) float64 column and row; (N,) float64 weights in grey values times pixels.
    """
    grey, column, begin = run_greys(packed, runs)
    weight = grey - packed.threshold
    in_run = np.add.reduceat(weight, begin)
    total = np.bincount(label, in_run, count).astype(np.float64)
    x = np.bincount(label, np.add.reduceat(weight * column, begin), count) / total
    return np.stack([x, np.bincount(label, in_run * runs.row, count) / total], axis=1), total
