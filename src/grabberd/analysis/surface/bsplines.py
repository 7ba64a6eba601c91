"""Quintic B-splines on knots of equal distance, with their derivatives."""

from functools import lru_cache
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.surface.jets import HIGHEST

DEGREE = 5


@lru_cache(maxsize=1)
def _pieces() -> NDArray[np.float64]:
    """(6, 6): coefficients [power, spline] of the six splines that live on one interval, argument 0 to 1."""
    pieces = np.zeros((DEGREE + 1, DEGREE + 1))
    for spline in range(DEGREE + 1):
        start = DEGREE - spline
        for knot in range(start + 1):
            weight = (-1) ** knot * comb(DEGREE + 1, knot) / factorial(DEGREE)
            for power in range(DEGREE + 1):
                pieces[power, spline] += weight * comb(DEGREE, power) * (start - knot) ** (DEGREE - power)
    return pieces


def splines(place: NDArray[np.float64], intervals: int, highest: int = HIGHEST) -> NDArray[np.float64]:
    """The splines and their derivatives by the place.

    Args:
        place: (N,) in knot intervals, 0 to `intervals`; beyond, the outermost pieces go on.
        intervals: how many there are.
        highest: order of the highest derivative.

    Returns:
        (N, highest + 1, intervals + 5): [place, derivative, spline].
    """
    first = np.clip(np.floor(place), 0, intervals - 1).astype(np.intp)
    powers = (place - first)[:, np.newaxis] ** np.arange(DEGREE + 1)
    values = np.zeros((len(place), highest + 1, intervals + DEGREE))
    rows, columns = np.arange(len(place))[:, np.newaxis], first[:, np.newaxis] + np.arange(DEGREE + 1)
    pieces = _pieces()
    for derivative in range(highest + 1):
        values[rows, derivative, columns] = powers[:, : len(pieces)] @ pieces
        pieces = pieces[1:] * np.arange(1, len(pieces))[:, np.newaxis]
    return values
