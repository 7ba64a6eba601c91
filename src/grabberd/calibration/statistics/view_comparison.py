"""Comparison of two views' parameters: do they share one lens?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from grabberd.calibration.adjustment.adjustment import Adjustment
from grabberd.geometry import PARAMETERS

COMPARED = (*PARAMETERS[:3], *PARAMETERS[9:])
"""Parameters of the interior; position and orientation always differ."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference of a parameter between two views.

    Attributes:
        parameter: Its name.
        first: Its value in the first view.
        second: Its value in the second view.
        difference: First minus second.
        sigma: Standard deviation of the difference, including the covariance of both.
        z: The difference over its σ.
        p: Two-sided probability of a difference at least so large by chance.
    """

    parameter: str
    first: float
    second: float
    difference: float
    sigma: float
    z: float
    p: float


def compare(adjusted: Adjustment, first: int = 0, second: int = 1) -> tuple[Difference, ...]:
    """Compare parameters of two views, by index, that were adjusted in at least one and are not shared."""
    one, other = (adjusted.unknowns.number[index] for index in (first, second))
    wanted = [
        index for index, name in enumerate(PARAMETERS) if name in COMPARED and one[index] != other[index]
    ]
    values = [adjusted.views[index].vector() for index in (first, second)]
    covariance = adjusted.parameter_covariance
    size = len(PARAMETERS)
    differences = []
    for index in wanted:
        at, beside = first * size + index, second * size + index
        variance = covariance[at, at] + covariance[beside, beside] - 2 * covariance[at, beside]
        sigma = float(np.sqrt(variance))
        differences.append(_difference(index, values, sigma, adjusted.freedom))
    return tuple(differences)


def _difference(index: int, values: list[NDArray[np.float64]], sigma: float, freedom: int) -> Difference:
    first, second = float(values[0][index]), float(values[1][index])
    z = (first - second) / sigma
    p = 2.0 * float(stdtr(freedom, -abs(z)))
    return Difference(PARAMETERS[index], first, second, first - second, sigma, z, p)
