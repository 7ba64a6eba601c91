"""Leans of a field's discs: how far the chords of each move from line to line, as its place has it.

Discs lie on a surface, so that their leans change slowly over either half of the picture: a quadratic in
their places for each, whose coefficients are unknowns beside the shifts of the lines.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.line_shifts.bands import band_half_solve

ANY_LEAN = 0.5
"""Standard deviation of leans, columns per frame line, before anything is known of them, and of their
coefficients: wide enough to draw no disc upright."""
ENOUGH = 12
"""Fewest discs in a half for a quadratic in their places, which has six terms."""
RIDGE = 0.01
"""Added to the diagonal of the normal equations: places in a straight line do not determine all terms."""

Array = NDArray[np.float64]


def terms_of(column: Array, line: Array, size: tuple[int, int]) -> Array:
    """(N, K) terms of both halves' quadratics at the places of N discs; 0 in a half with few discs.

    Args:
        column: (N,) float64, columns of the discs' centres.
        line: (N,) float64, their field lines.
        size: Lines and columns of the field.
    """
    lines, columns = size
    right = column >= columns / 2
    u = 4.0 * column / columns - np.where(right, 3.0, 1.0)
    v = 2.0 * line / lines - 1.0
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    halves = [np.where(half[:, np.newaxis] & (half.sum() >= ENOUGH), terms, 0.0) for half in (~right, right)]
    return np.concatenate(halves, axis=1)


def smoothed(lean: Array, terms: Array) -> Array:
    """(N,) leans of discs at such places, from those found (N,)."""
    normal = terms.T @ terms + RIDGE * np.eye(terms.shape[1])
    smooth: Array = terms @ np.linalg.solve(normal, terms.T @ lean)
    return smooth


class Left(NamedTuple):
    """Rest of the leans' equations after eliminating the shifts, whose band matrix is L·Lᵀ.

    Attributes:
        half: (L, K) L⁻¹ of what ties the leans to the shifts.
        root: (K, K) lower Cholesky factor of the rest.
        rest: (K,) its solution downwards.
    """

    half: Array
    root: Array
    rest: Array

    def solution(self) -> Array:
        """(K,) most likely coefficients."""
        coefficients: Array = _solve_lower(self.root, self.rest, trans=1)
        return coefficients

    def half_solve(self, halves: Array) -> Array:
        """(K, M) what the leans' errors add to right sides of which L⁻¹ (L, M) is given, as that does."""
        added: Array = _solve_lower(self.root, self.half.T @ halves)
        return added


class Leans(NamedTuple):
    """K coefficients as unknowns beside L shifts: their part of the normal equations.

    Attributes:
        shifts: (L, K) against the shifts.
        own: (K, K) against each other, prior included.
        right: (K,) right side.
    """

    shifts: Array
    own: Array
    right: Array

    @classmethod
    def of(
        cls, terms: Array, at: NDArray[np.int64], steep: Array, beside: Array, centre: Array, count: int
    ) -> "Leans":
        """Make them from N discs with h chords.

        Args:
            terms: (N, K) terms of the discs' places.
            at: (N, h) equation of each chord.
            steep: (N, h) weighted Δy of each, less what the disc's own unknowns take up of it.
            beside: (N, h) Δy.
            centre: (N, h) middles of the chords.
            count: Number of shifts.
        """
        size = terms.shape[1]
        cell = at[:, :, np.newaxis] * size + np.arange(size)
        each = steep[:, :, np.newaxis] * terms[:, np.newaxis]
        shifts = np.bincount(cell.ravel(), each.ravel(), count * size).reshape(count, size)
        own = (terms.T * (steep * beside).sum(axis=1)) @ terms + np.eye(size) / ANY_LEAN**2
        return cls(shifts.astype(np.float64), own, terms.T @ (steep * centre).sum(axis=1))

    def left(self, lower: Array, right: Array) -> Left:
        """Eliminate the shifts, given their band's Cholesky factor and right side (L,)."""
        half = band_half_solve(lower, self.shifts)
        root: Array = np.asarray(np.linalg.cholesky(self.own - half.T @ half), np.float64)
        rest: Array = _solve_lower(root, self.right - half.T @ band_half_solve(lower, right))
        return Left(half, root, rest)


def _solve_lower(lower: Array, right: Array, trans: Literal[0, 1] = 0) -> Array:
    """Solve for right sides, given a lower triangle, or its transpose if `trans` is 1."""
    from scipy.linalg import solve_triangular  # noqa: PLC0415 - see `bands`

    solution: Array = solve_triangular(lower, right, lower=True, trans=trans)
    return solution
