"""Forces on the wall's unknowns by its parameters, above all by the fields of its load."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.wall.rows import NEAR, Rows

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """Derivative (n, P) of the force out of balance by F fields' control values and by Q other parameters.

    Attributes:
        rows: blocks of the unknowns.
        fields: (R, 7 B, F, C) by the control values of each row, in the blocks from three before it on.
        others: (n, Q).
    """

    rows: Rows
    fields: Array
    others: Array

    @property
    def _by_row(self) -> Array:
        """(R, 7 B, F C)."""
        return self.fields.reshape(*self.fields.shape[:2], -1)

    def of(self, change: Array) -> Array:
        """(n,) force of a change (P,) of the parameters; the control values of each field stand together."""
        rows, _, fields, columns = self.fields.shape
        count = rows * fields * columns
        by_row = change[:count].reshape(fields, rows, columns).transpose(1, 0, 2).reshape(rows, -1, 1)
        blocks = (self._by_row @ by_row).reshape(rows, NEAR, self.rows.size)
        force = np.zeros((rows + NEAR - 1, self.rows.size))
        for step in range(NEAR):
            force[step : step + rows] += blocks[:, step]
        return self.rows.unpadded(force.reshape(-1, 1))[:, 0] + self.others @ change[count:]

    def transposed(self, adjoint: Array) -> Array:
        """(M, P) products with columns (n, M)."""
        rows, near, fields, columns = self.fields.shape
        padded, by_row = self.rows.padded(adjoint), self._by_row
        products = np.empty((adjoint.shape[1], fields, rows, columns))
        for row in range(rows):
            start = row * self.rows.size
            product = padded[start : start + near].T @ by_row[row]
            products[:, :, row] = product.reshape(-1, fields, columns)
        return np.hstack([products.reshape(len(products), -1), adjoint.T @ self.others])
