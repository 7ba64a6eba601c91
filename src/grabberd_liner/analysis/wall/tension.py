"""The tension in the wall, from its stretches and its material.

The state before mounting → (pre-tension, `Wall.along` and `Wall.across`) → the reference state, mounted →
(measured) → the present one: the stretches compose, and the law sees them all at once.
"""

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.wall.forms import determinant, inverse, trace
from grabberd_liner.analysis.wall.material import Wall

Array = NDArray[np.float64]

_UNIT = np.eye(2)


def mixed_tension(first: Array, reference_first: Array, wall: Wall) -> Array:
    """(..., 2, 2) T^α_β in N/mm."""
    squared = total_stretch_squared(reference_first, wall) @ first
    neo, linear = _neo_hookean(squared, wall), _linear(squared, wall)
    return np.where(wall.neo_hookean[..., None, None], neo, linear)


def total_stretch_squared(reference_first: Array, wall: Wall) -> Array:
    """(..., 2, 2) contravariant components of B = F Fᵀ, from before mounting to the present state.

    The pre-tension acts along the rows' coordinate u.
    """
    along = np.zeros_like(reference_first)
    along[..., 0, 0] = 1 / reference_first[..., 0, 0]
    across = inverse(reference_first) - along
    return _tensor(wall.along) ** 2 * along + _tensor(wall.across) ** 2 * across


def _neo_hookean(squared: Array, wall: Wall) -> Array:
    """µ t λ3 (B − λ3² 1), with µ = E/3, t and the thickness stretch before B from the mounted wall."""
    total = determinant(squared)
    measured = np.sqrt(total) / (wall.along * wall.across)
    scale = wall.E_mpa / 3 * wall.wall_mm / measured
    result: Array = _tensor(scale) * (squared - _tensor(1 / total) * _UNIT)
    return result


def _linear(squared: Array, wall: Wall) -> Array:
    """E t / (1 − ν²) [(1 − ν) ε + ν tr ε 1] with ε = V − 1, V² = B; V by Cayley and Hamilton."""
    root = np.sqrt(determinant(squared))
    stretch = (squared + _tensor(root) * _UNIT) / _tensor(np.sqrt(trace(squared) + 2 * root))
    strain = stretch - _UNIT
    own, even = _tensor(1 - wall.poisson), _tensor(wall.poisson * trace(strain))
    scale = wall.E_mpa * wall.wall_mm / (1 - wall.poisson**2)
    result: Array = _tensor(scale) * (own * strain + even * _UNIT)
    return result


def _tensor(scalar: Array) -> Array:
    return np.asarray(scalar)[..., None, None]
