"""Gauss's rule of quadrature, found once: its nodes take as long as many of the sums that they serve."""

from functools import lru_cache

import numpy as np

from grabberd_liner.arrays import Array


@lru_cache(maxsize=32)
def gauss_rule(count: int) -> tuple[Array, Array]:
    """(count,) nodes between −1 and 1, and their weights; shared, so not to be written to."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights
