"""Matrix of what spline fields on the wall, such as its load, do to the wall's unknowns."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class FieldLayout:
    """Places of the patches' entries in the matrix of one field, which are the same for every state.

    Attributes:
        unknowns: number n of the wall's unknowns.
        rows: (E,) row of each entry, column after column; `starts`: (K + 1,) first entry of each column.
    """

    unknowns: int
    rows: Indices
    starts: Indices
    _position: Indices

    @classmethod
    def of(cls, members: Indices, order: Indices, count: int) -> "FieldLayout":
        """Layout for patches.

        Args:
            members: (P, 16) numbers of their control points.
            order: (P, 16, 4) numbers of the unknowns that those points' values follow; −1 for a held one.
            count: number K of all control points.
        """
        unknowns = int(order.max()) + 1
        row, column = np.broadcast_arrays(order[..., np.newaxis], members[:, np.newaxis, np.newaxis])
        free = row >= 0
        entries, place = np.unique(column[free] * unknowns + row[free], return_inverse=True)
        # Held control values share one place behind the entries.
        position = np.full(row.shape, len(entries))
        position[free] = place
        starts = np.searchsorted(entries, unknowns * np.arange(count + 1))
        return cls(unknowns, entries % unknowns, starts, position.ravel())

    def sums(self, patches: Array) -> Array:
        """(E,) entries for one field, from its patches (P, 16, 4, 16): values moved by control values."""
        entries = len(self.rows)
        return np.asarray(np.bincount(self._position, patches.ravel(), entries + 1)[:entries], np.float64)

    def matrix(self, sums: Sequence[Array]) -> sparse.csc_matrix:
        """(n, M K) matrix of M fields from the entries of each; the control values of each stand together."""
        fields, entries = len(sums), len(self.rows)
        starts = self.starts[:-1] + entries * np.arange(fields)[:, np.newaxis]
        shape = (self.unknowns, fields * (len(self.starts) - 1))
        parts = (np.concatenate(sums), np.tile(self.rows, fields), np.append(starts, fields * entries))
        return sparse.csc_matrix(parts, shape=shape)
