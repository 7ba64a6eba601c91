"""Symmetric positive definite equations with a band matrix, by LAPACK."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def band_of(row: NDArray[np.int64], column: NDArray[np.int64], value: Array, shape: tuple[int, int]) -> Array:
    """Sum elements into a symmetric band matrix (h, count), its diagonals from the main one down.

    Args:
        row: Row of each element.
        column: Column of each element, at most h − 1 less than its row.
        value: The elements, of the same shape.
        shape: h and the number of equations.
    """
    height, count = shape
    flat = (row - column) * count + column
    return np.bincount(flat.ravel(), value.ravel(), height * count).reshape(shape).astype(np.float64)


def band_factor(band: Array, more: float) -> Array:
    """(h, count) lower Cholesky factor of a band with `more` added to its main diagonal."""
    own = band.copy(order="F")
    own[0] += more
    lower: Array = _lapack().dpbtrf(own, lower=1, overwrite_ab=1)[0]
    return lower


def band_solve(lower: Array, right: Array) -> Array:
    """Solve for right sides (count,) or (count, M), given the Cholesky factor."""
    solution: Array = _lapack().dpbtrs(lower, right, lower=1)[0]
    return solution


def band_half_solve(lower: Array, right: Array) -> Array:
    """Apply L⁻¹ to right sides (count, M): products of the results are quadratic forms of the inverse."""
    solution: Array = _lapack().dtbtrs(lower, right, uplo="L")[0]
    return solution


def _lapack() -> Any:
    from scipy.linalg import lapack  # noqa: PLC0415 - 20 MB with what it loads, and the kernel needs none

    return lapack
