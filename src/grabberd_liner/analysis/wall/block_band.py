"""Factors of the wall's stiffness, block by block.

The stiffness is nearly symmetric, and positive unless the wall is about to buckle, so pivots are sought
within a block alone. Products of blocks are several times faster than solving column by column.
"""

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.wall.rows import Rows
from grabberd_liner.analysis.wall.splines import DEGREE

Array = NDArray[np.float64]


class Factors:
    """Factors of a matrix, for its solutions and its transpose's."""

    def __init__(self, rows: Rows, band: Array) -> None:
        """Factors the matrix.

        Args:
            rows: blocks of its unknowns.
            band: (R, B, 7 B) as in `Rows.band`.

        Raises:
            np.linalg.LinAlgError: a block is singular.
        """
        self._rows, size, later = rows, rows.size, DEGREE * rows.size
        self._inverse = np.empty((rows.count, size, size))
        self._lower = np.empty((rows.count, later, size))
        self._upper = np.empty((rows.count, size, later))
        window = np.zeros((later + size, later + size))
        for row in range(-DEGREE, rows.count):
            # The window moves on by a block: what is left of it, and one row and one column more.
            window[:later, :later] = window[size:, size:]
            window[later:], window[:, later:] = 0.0, 0.0
            if row + DEGREE < rows.count:
                window[later:] = band[row + DEGREE, :, : later + size]
                for above in range(max(row, 0), row + DEGREE):
                    block = band[above, :, (2 * DEGREE + row - above) * size :][:, :size]
                    window[(above - row) * size : (above - row + 1) * size, later:] = block
            if row < 0:
                continue
            self._inverse[row] = np.linalg.inv(window[:size, :size])
            self._upper[row] = window[:size, size:]
            np.matmul(window[size:, :size], self._inverse[row], out=self._lower[row])
            window[size:, size:] -= self._lower[row] @ self._upper[row]

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """(n,) or (n, M) solutions for right-hand sides of that shape."""
        solved = self._rows.padded(right.reshape(len(right), -1))
        (self._solve_transposed if transposed else self._solve)(solved)
        return self._rows.unpadded(solved).reshape(right.shape)

    def _solve(self, solved: Array) -> None:
        for row in range(self._rows.count):
            own, later = self._parts(row)
            solved[later] -= self._lower[row] @ solved[own]
        for row in reversed(range(self._rows.count)):
            own, later = self._parts(row)
            solved[own] = self._inverse[row] @ (solved[own] - self._upper[row] @ solved[later])

    def _solve_transposed(self, solved: Array) -> None:
        for row in range(self._rows.count):
            own, later = self._parts(row)
            solved[own] = self._inverse[row].T @ solved[own]
            solved[later] -= self._upper[row].T @ solved[own]
        for row in reversed(range(self._rows.count)):
            own, later = self._parts(row)
            solved[own] -= self._lower[row].T @ solved[later]

    def _parts(self, row: int) -> tuple[slice, slice]:
        """A block's own places among the padded ones, and those of the three after it."""
        start, size = (row + DEGREE) * self._rows.size, self._rows.size
        return slice(start, start + size), slice(start + size, start + (DEGREE + 1) * size)
