"""Batches of symmetric 3×3 matrices, each stored as its six elements 00 01 02 11 12 22."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST, SECOND = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
"""Row and column of each of the six elements."""
DIAGONAL = (0, 3, 5)
"""Indices of the diagonal elements among the six."""
_SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_COFACTORS = np.array([(3, 2, 1, 0, 1, 0), (5, 4, 4, 5, 2, 3), (4, 1, 2, 2, 0, 1), (4, 5, 3, 2, 4, 1)])


def inverse_symmetric(six: Array) -> Array:
    """Invert N symmetric matrices given by their six elements (6, N), as (3, 3, N); rank is not checked."""
    first, second, third, fourth = six[_COFACTORS]
    cofactors = first * second - third * fourth
    determinant = (six[:3] * cofactors[:3]).sum(axis=0)
    inverse: Array = (cofactors / determinant)[_SQUARE]
    return inverse
