"""Fields that are missing from a capture, as the pulsation sees them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.pulsation.pulsation import Pulsation


class Gap(NamedTuple):
    """Fields that are missing between two that are there.

    Attributes:
        after_s: time of the last field before it; `until_s`: of the first one after it.
        fields: how many are missing.
        resets: it is longer than a cycle: the count of cycles begins anew behind it.
    """

    after_s: float
    until_s: float
    fields: int
    resets: bool


def gaps(time_s: NDArray[np.float64], pulsation: Pulsation, field_s: float = 0.02) -> tuple[Gap, ...]:
    """Every gap of a capture: none is filled, the mean cycle does without.

    Args:
        time_s: (F,) times of the fields that have points, ascending.
        pulsation: of that capture.
        field_s: from field to field.
    """
    steps = np.rint(np.diff(time_s) / field_s).astype(int)
    return tuple(
        Gap(
            float(time_s[k]),
            float(time_s[k + 1]),
            int(steps[k] - 1),
            bool(time_s[k + 1] - time_s[k] > pulsation.period_s),
        )
        for k in np.flatnonzero(steps > 1)
    )
