"""Unknowns of the wall in blocks, one for each row of control points round it; factors of its stiffness, and
forces on it by its parameters, block by block.

Patches reach over four rows of control points, so a block has to do with the three before and after it. All
are equally large: a place that is held takes part as a number that is always zero. The stiffness is nearly
symmetric, and positive unless the wall is about to buckle, so pivots are sought within a block alone;
products of blocks are several times faster than solving column by column.
"""

from dataclasses import dataclass

import numpy as np

from grabberd_liner.analysis.wall.splines import DEGREE
from grabberd_liner.arrays import Array, Indices, Mask

NEAR = 2 * DEGREE + 1
"""Blocks that a block has to do with, itself included."""
_SPAN = DEGREE + 1
"""Control points of a patch in either direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Places of the unknowns, R blocks of B, for C control points in a row.

    Attributes:
        count: R; `size`: B.
        unknowns: (n,) place of each unknown in all R B; `held`: (R, B) True for places that no unknown has.
        free: (slabs, arcs, 64) 1 for control values of a patch that follow an unknown, 0 for held ones.
    """

    count: int
    size: int
    unknowns: Indices
    held: Mask
    free: Array
    _stiffness: Indices
    _fields: Indices

    @classmethod
    def of(cls, order: Indices) -> "Rows":
        """Blocks for control values whose unknowns' numbers are `order` (R, C, 4); −1 for held ones."""
        rows, columns, values = order.shape
        first = order[rows // 2][order[rows // 2] >= 0].min()
        # A place within a block is the same in all rows; those at the ends only lack some.
        local = np.where(order[rows // 2] >= 0, order[rows // 2] - first, 0)
        size = int(local.max()) + 1
        row = np.broadcast_to(np.arange(rows)[:, np.newaxis, np.newaxis], order.shape)
        unknowns = np.zeros(int(order.max()) + 1, np.intp)
        unknowns[order[order >= 0]] = (row * size + local)[order >= 0]
        held = np.ones(rows * size, np.bool_)
        held[unknowns] = False
        arcs = np.arange(columns - DEGREE)[:, np.newaxis] + np.arange(_SPAN)
        slabs = np.arange(rows - DEGREE)[:, np.newaxis] + np.arange(_SPAN)
        free = order[slabs[:, np.newaxis, :, np.newaxis], arcs[np.newaxis, :, np.newaxis]] >= 0
        of_patch = np.broadcast_to(local[arcs][:, np.newaxis], (len(arcs), _SPAN, _SPAN, values))
        return cls(
            rows,
            size,
            unknowns,
            held.reshape(rows, size),
            free.reshape(len(slabs), len(arcs), -1).astype(np.float64),
            _stiffness_places(of_patch, size),
            _field_places(of_patch, arcs, size, columns),
        )

    def band(self) -> Array:
        """(R, B, 7 B) matrix of what is held: by blocks, beside those from three rows before them on."""
        band = np.zeros((self.count, self.size, NEAR * self.size))
        row, place = self.held.nonzero()
        band[row, place, DEGREE * self.size + place] = 1.0
        return band

    def add_stiffness(self, band: Array, slab: int, patches: Array) -> None:
        """Adds the matrices (arcs, 64, 64) of a slab's patches to a band."""
        free = self.free[slab]
        weighted = patches * free[:, :, np.newaxis] * free[:, np.newaxis]
        rows = band[slab : slab + _SPAN]
        rows += np.bincount(self._stiffness, weighted.ravel(), rows.size).reshape(rows.shape)

    def add_field(self, band: Array, slab: int, patches: Array) -> None:
        """Adds patches (arcs, 64, 16), values moved by control values, to a field's band (R, 7 B, C)."""
        weighted = patches * self.free[slab][:, :, np.newaxis]
        rows = band[slab : slab + _SPAN]
        rows += np.bincount(self._fields, weighted.ravel(), rows.size).reshape(rows.shape)

    def padded(self, right: Array) -> Array:
        """((R + 6) B, M) what belongs to the unknowns (n, M), in blocks; three of zeros before and after."""
        padded = np.zeros(((self.count + 2 * DEGREE) * self.size, right.shape[1]))
        padded[self.unknowns + DEGREE * self.size] = right
        return padded

    def unpadded(self, padded: Array) -> Array:
        """(n, M) what belongs to the unknowns, from blocks."""
        return padded[self.unknowns + DEGREE * self.size]


def _stiffness_places(local: Indices, size: int) -> Indices:
    """Place of each entry of a slab's patches in its four rows of the band; `local`: (arcs, 4, 4, 4)."""
    row, place = _rows_of(local), local
    step = row[:, np.newaxis] - row[:, :, np.newaxis] + DEGREE  # [arc, entry's row, entry's column]
    flat = place.reshape(len(place), -1)
    column = step * size + flat[:, np.newaxis]
    places = (row[:, :, np.newaxis] * size + flat[:, :, np.newaxis]) * (NEAR * size) + column
    return np.asarray(places.ravel(), np.intp)


def _field_places(local: Indices, arcs: Indices, size: int, columns: int) -> Indices:
    """Place of each entry (arcs, 64, 16) of a slab's patches in its four rows of a field's band."""
    row, flat = _rows_of(local), local.reshape(len(local), -1)
    field_row = np.repeat(np.arange(_SPAN), _SPAN)
    field_column = np.tile(arcs, (1, _SPAN))
    step = row[:, :, np.newaxis] - field_row + DEGREE
    places = (field_row * NEAR + step) * size + flat[:, :, np.newaxis]
    return np.asarray((places * columns + field_column[:, np.newaxis]).ravel(), np.intp)


def _rows_of(local: Indices) -> Indices:
    """(arcs, 64) row of each control value of a patch, from 0 to 3."""
    row = np.arange(_SPAN)[np.newaxis, :, np.newaxis, np.newaxis]
    return np.broadcast_to(row, local.shape).reshape(len(local), -1)


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
