"""Symmetric positive definite equations whose matrix is a band."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

Array = NDArray[np.float64]


def band_of(row: NDArray[np.int64], column: NDArray[np.int64], value: Array, shape: tuple[int, int]) -> Array:
    """(h, count) sums of the elements of a symmetric matrix, its diagonals from the main one down.

    Args:
        row: equation of each element.
        column: likewise, at most h − 1 less.
        value: the elements, of the same shape.
        shape: h and how many equations there are.
    """
    height, count = shape
    place = (row - column) * count + column
    band: Array = np.bincount(place.ravel(), value.ravel(), height * count).reshape(shape).astype(np.float64)
    return band


def factor(band: Array, more: float) -> Array:
    """(h, count) lower Cholesky factor of a band with so much more on its main diagonal."""
    own = band.copy(order="F")
    own[0] += more
    lower: Array = lapack.dpbtrf(own, lower=1, overwrite_ab=1)[0]
    return lower


def solve(lower: Array, right: Array) -> Array:
    """Solution for the right sides (count,) or (count, M)."""
    solution: Array = lapack.dpbtrs(lower, right, lower=1)[0]
    return solution


def half_solve(lower: Array, right: Array) -> Array:
    """L⁻¹ of the right sides (count, M): the products of its columns are those with the inverse between."""
    solution: Array = lapack.dtbtrs(lower, right, uplo="L")[0]
    return solution
