"""A value with its standard deviation."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Estimate(NamedTuple):
    """Values and their σ.

    Attributes:
        value: any shape; the unit stands in the name of the field or function that gives it.
        sigma: (same shape) one standard deviation, in the same unit; NaN where the value is.
    """

    value: NDArray[np.float64]
    sigma: NDArray[np.float64]
