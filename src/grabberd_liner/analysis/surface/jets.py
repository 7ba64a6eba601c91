"""A jet: all partial derivatives of a surface at one position, up to order four.

Every local quantity of a surface is a pure function of its jet: first forms and strain need order 1,
curvature 2, the wall's equilibrium with bending 4.
"""

from math import comb

import numpy as np

from grabberd.core.arrays import Array

Jets = Array
"""(..., 15, 3): ∂^(i+j) X / ∂u^i ∂v^j at `index(i, j)`, mm / mm^(i+j), in the object's frame."""

HIGHEST = 4

ORDERS: tuple[tuple[int, int], ...] = tuple(
    (order - j, j) for order in range(HIGHEST + 1) for j in range(order + 1)
)
"""The pairs (i, j), i + j ≤ 4: (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), …"""


def index(i: int, j: int) -> int:
    """Index of ∂^(i+j) X / ∂u^i ∂v^j in a jet."""
    order = i + j
    return order * (order + 1) // 2 + j


def count_to(order: int) -> int:
    """Number of derivatives up to an order; they come first in a jet."""
    return index(0, order) + 1


def times(factor: Jets) -> Array:
    """(..., 15, 15, 3) the matrix that makes a scalar's 15 derivatives the jet of scalar · factor (Leibniz).

    Args:
        factor: (..., 15, 3) jet of a vector.
    """
    matrix = np.zeros((*factor.shape[:-2], len(ORDERS), len(ORDERS), 3))
    for i, j in ORDERS:
        for a in range(i + 1):
            for b in range(j + 1):
                weight = comb(i, a) * comb(j, b)
                matrix[..., index(i, j), index(a, b), :] = weight * factor[..., index(i - a, j - b), :]
    return matrix
