"""The first touch: where and when the wall begins to press the teat."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.pressure import PressureMap

_TOUCHES = 3.0
"""σ from which on a pressure shows that the wall touches the teat."""


class Touch(NamedTuple):
    """The first touch: index of the map in a series, and of the target in it."""

    field: int
    place: int


def first_touch(maps: Sequence[PressureMap]) -> Touch:
    """The first field with a target whose pressure exceeds `_TOUCHES` σ in that field and the next.

    Raises:
        AnalysisError: there is no such field.
    """
    pressed = [_ratio(one) > _TOUCHES for one in maps]
    lasting = [now & after for now, after in pairwise(pressed)]
    field = next((at for at, places in enumerate(lasting) if places.any()), None)
    if field is None:
        raise AnalysisError(
            f"in none of {len(maps)} fields, and the next, does a pressure exceed {_TOUCHES:g} times its σ",
            "name the field of the first touch yourself, or average over phases for a smaller σ",
        )
    ratio = np.where(lasting[field], _ratio(maps[field]), -np.inf)
    return Touch(field, int(np.argmax(ratio)))


def _ratio(one: PressureMap) -> Array:
    return np.where(one.usable, one.contact_kpa.value / one.contact_kpa.sigma, -np.inf)
