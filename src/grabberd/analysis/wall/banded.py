"""Stiffness matrix of the wall: patches summed into a band, and its factors.

Control points are numbered round the wall first, so those of a patch are at most three rows and
three columns apart, which keeps the band narrow.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

PATCH = 64
"""Control values that matter on one patch: 16 control points of four values."""


class Banded:
    """Factors of a banded matrix, for its solutions and its transpose's."""

    def __init__(self, band: Array, width: int) -> None:
        """Factors the matrix.

        Args:
            band: (3 width + 1, n) in the layout of LAPACK's `gbtrf`; overwritten.
            width: number of diagonals below the main one, and above it.

        Raises:
            np.linalg.LinAlgError: the matrix is singular.
        """
        self._width = width
        self._factors, self._pivots, info = lapack.dgbtrf(band, width, width, overwrite_ab=True)
        if info:
            raise np.linalg.LinAlgError(f"the wall's stiffness is singular at unknown {info}")

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """(n,) or (n, M) solutions for right-hand sides of that shape."""
        solved: Array
        solved, _ = lapack.dgbtrs(
            self._factors, self._width, self._width, right, self._pivots, trans=int(transposed)
        )
        return solved


@dataclass(frozen=True, slots=True, eq=False)
class BandLayout:
    """Places of the patches' matrices in the band.

    Attributes:
        width: number of diagonals below the main one.
        unknowns: (P, 64) number of the unknown that each control value of a patch is; −1 for a held one.
        count: number of unknowns.
    """

    width: int
    unknowns: Indices
    count: int
    _position: Indices

    @classmethod
    def of(cls, unknowns: Indices, count: int) -> "BandLayout":
        """Layout for patches with the given unknowns (P, 64), `count` in all."""
        row, column = unknowns[:, :, np.newaxis], unknowns[:, np.newaxis]
        inside = (row >= 0) & (column >= 0)
        width = int(np.where(inside, row - column, 0).max())
        height = 3 * width + 1
        # LAPACK's layout, column after column; held control values share one place behind it.
        position = np.where(inside, 2 * width + row - column + height * column, height * count)
        return cls(width, unknowns, count, position.ravel())

    def factors(self, patches: Array) -> Banded:
        """Factors of the sum of the patches' matrices (P, 64, 64)."""
        height = 3 * self.width + 1
        sums = np.bincount(self._position, patches.ravel(), height * self.count + 1)
        return Banded(np.asarray(sums[:-1], np.float64).reshape(self.count, height).T, self.width)
