"""The first touch: where and when the wall begins to press on the teat."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.pressure import PressureMap

Array = NDArray[np.float64]


class Touch(NamedTuple):
    """The first touch: index of the map in a series, and of the target in it."""

    field: int
    place: int


def first_touch(maps: Sequence[PressureMap], limit: float = 3.0) -> Touch:
    """The first field with a target whose pressure exceeds `limit` σ in that field and the next.

    Raises:
        AnalysisError: there is no such field.
    """
    pressed = [_ratio(one) > limit for one in maps]
    lasting = [now & after for now, after in pairwise(pressed)]
    field = next((at for at, places in enumerate(lasting) if places.any()), None)
    if field is None:
        raise AnalysisError(
            f"in none of {len(maps)} fields, and the next, does a pressure exceed {limit:g} times its σ",
            "name the field of the first touch yourself, or average over phases for a smaller σ",
        )
    ratio = np.where(lasting[field], _ratio(maps[field]), -np.inf)
    return Touch(field, int(np.argmax(ratio)))


def _ratio(one: PressureMap) -> Array:
    ratio: Array = np.where(one.usable, one.contact_kpa.value / one.contact_kpa.sigma, -np.inf)
    return ratio
