"""Leans of a field's discs: how far the chords of each move from line to line, as its place has it.

Discs lie on a surface, so that their leans change slowly over either half of the picture.
"""

import numpy as np
from numpy.typing import NDArray

ENOUGH = 12
"""Fewest discs in a half for a quadratic in their places, which has six terms."""
RIDGE = 0.01
"""Added to the diagonal of the normal equations: places in a straight line do not determine all terms."""

Array = NDArray[np.float64]


def leans_by_place(lean: Array, column: Array, line: Array, size: tuple[int, int]) -> Array:
    """(N,) leans of N discs as a quadratic in their places, one for each half; 0 in a half with few discs.

    Args:
        lean: (N,) float64, columns per frame line.
        column: (N,) float64, columns of the discs' centres.
        line: (N,) float64, their field lines.
        size: Lines and columns of the field.
    """
    lines, columns = size
    right = column >= columns / 2
    u = 4.0 * column / columns - np.where(right, 3.0, 1.0)
    v = 2.0 * line / lines - 1.0
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    smooth = np.zeros_like(lean)
    for half in (~right, right):
        own = terms[half]
        if len(own) >= ENOUGH:
            normal = own.T @ own + RIDGE * np.eye(terms.shape[1])
            smooth[half] = own @ np.linalg.solve(normal, own.T @ lean[half])
    return smooth
