"""Surfaces that are known exactly, at any place and without any points."""

import numpy as np

from grabberd_liner.analysis.surface.smoothing import Domain, Smoothing, modes
from grabberd_liner.analysis.surface.surface import Surface

PITCH_MM = 6.5
SMOOTHING = Smoothing(45.0, 10.0, (0.1, 2.0, 1.5))


def exact_surface(shape, rows=8, columns=6, missing=()):
    """The surface of jets `shape`(u, v), material coordinates counted from the middle of the grid."""
    along, across = (rows - 1) / 2 * PITCH_MM, (columns - 1) / 2 * PITCH_MM
    domain = Domain(0.0, 0.0, PITCH_MM, PITCH_MM, rows, columns)
    size = modes(domain, SMOOTHING.along_mm, SMOOTHING.round_mm).size
    supported = np.ones((rows, columns), bool)
    for place in missing:
        supported[place] = False
    return Surface(
        base=lambda u, v: shape(u - along, v - across),
        modes=modes(domain, SMOOTHING.along_mm, SMOOTHING.round_mm),
        coefficients=np.zeros((3, size)),
        factor=np.zeros((3, size, 1)),
        smoothing=SMOOTHING,
        supported=supported,
        outward=1.0,
        misfit=1.0,
        problems=(),
    )
