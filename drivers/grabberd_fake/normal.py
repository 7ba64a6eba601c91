"""The normal distribution, for arrays; the standard library has it for single numbers only."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.optics import Array

_END = 6.0
_GRID = np.linspace(-_END, _END, 6145)
_DISTRIBUTION = np.array([0.5 * math.erfc(-z / math.sqrt(2)) for z in _GRID])


def normal_distribution(z: Array) -> Array:
    """Φ(z), to 1e-7."""
    below: Array = np.interp(z, _GRID, _DISTRIBUTION)
    return below


def normal_integral(z: Array) -> Array:
    """∫ Φ from −∞ to z, to 1e-6: z Φ(z) + φ(z)."""
    integral: Array = z * normal_distribution(z) + np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)
    return integral


@lru_cache(maxsize=1)
def normal_quantiles() -> NDArray[np.float64]:
    """(65536,) the quantiles of (i + ½)/65536: indexed by random 16-bit numbers, normal noise."""
    return np.interp((np.arange(65536) + 0.5) / 65536, _DISTRIBUTION, _GRID)
