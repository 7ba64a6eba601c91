"""A value with its standard deviation."""

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
