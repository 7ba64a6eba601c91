"""Targets: discs in space."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.optics import Array


class Targets(NamedTuple):
    """N discs.

    Attributes:
        xyz_mm: (N, 3) their centres in the object's frame; `normal`: (N, 3) unit vectors, outward.
    """

    xyz_mm: Array
    normal: Array


def grid_numbers(rows: int, columns: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Row and column of every place of a grid, row by row; (rows · columns,) each."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int32), np.int32(columns))
    return row, column
