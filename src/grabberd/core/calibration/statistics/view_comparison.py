"""Comparison of two views' parameters: do they share one lens?"""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.geometry import PARAMETERS

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
    number, size = adjusted.unknowns.number, len(PARAMETERS)
    vectors = [adjusted.views[index].vector().tolist() for index in (first, second)]
    covariance = adjusted.parameter_covariance
    differences = []
    for index, (name, one, other) in enumerate(zip(PARAMETERS, *vectors, strict=True)):
        if name not in COMPARED or number[first, index] == number[second, index]:
            continue
        at, beside = first * size + index, second * size + index
        variance = covariance[at, at] + covariance[beside, beside] - 2 * covariance[at, beside]
        sigma = float(np.sqrt(variance))
        z = (one - other) / sigma
        p = 2.0 * float(stdtr(adjusted.freedom, -abs(z)))
        differences.append(Difference(name, one, other, one - other, sigma, z, p))
    return tuple(differences)
