"""Values with their standard deviations, or with their whole covariance."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Estimate(NamedTuple):
    """Values and their σ.

    Attributes:
        value: values of any shape; the unit is in the name of the field or function that returns them.
        sigma: (same shape) one standard deviation, in the same unit; NaN where the value is NaN.
    """

    value: NDArray[np.float64]
    sigma: NDArray[np.float64]


class Joint(NamedTuple):
    """N values whose errors go together.

    Attributes:
        value: (N,) values; the unit is in the name of the field or function that returns them.
        covariance: (N, N) in the square of that unit.
    """

    value: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @property
    def estimate(self) -> Estimate:
        """(N,) the values one by one."""
        return Estimate(self.value, np.sqrt(np.diagonal(self.covariance)))

    def summed(self, weights: NDArray[np.float64]) -> Estimate:
        """Sums of the values with weights (…, N), with the σ of each sum."""
        variance = ((weights @ self.covariance) * weights).sum(axis=-1)
        return Estimate(weights @ self.value, np.sqrt(np.maximum(variance, 0.0)))
