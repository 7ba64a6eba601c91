"""The first touch as a reference for pressures, and the free wall as a check of inputs and model."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.load.pressure import PressureMap
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]


class Touch(NamedTuple):
    """The first touch: index of the map in a series, and of the target in it."""

    field: int
    place: int


class FreeWall(NamedTuple):
    """Residual p_contact where the wall is known to be free; it should be zero.

    Attributes:
        residual_kpa: weighted mean of the residuals; its σ treats the targets as fully dependent, so it is
            never too small.
        misfit: mean square of the residuals in units of σ: about 1 if inputs and σ are right.
        worst: (target, multiple of its σ) of the greatest residual.
        agrees: True if the mean is within `limit` σ of zero and the root of the misfit within the limit, too.
    """

    residual_kpa: Estimate
    misfit: float
    worst: tuple[int, float]
    agrees: bool


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


def since_touch(now: PressureMap, touch: PressureMap) -> Estimate:
    """(N,) kPa: the pressure above that at the same places in the field of the touch.

    Errors common to both fields (material, vacuum gauges, offset in time) cancel.
    """
    own = now.shares.points_kpa**2 + touch.shares.points_kpa**2
    common = ((now.shares.common_kpa - touch.shares.common_kpa) ** 2).sum(axis=0)
    return _difference(now.contact_kpa.value - touch.contact_kpa.value, own + common)


def free_wall(one: PressureMap, free: NDArray[np.bool_], limit: float = 3.0) -> FreeWall:
    """The self-check where the wall is known to be free: an empty liner, or beside the teat.

    Args:
        one: the pressure map.
        free: (N,) True where nothing touches the wall.
        limit: limit in σ.

    Raises:
        AnalysisError: the map has no pressure at any of these targets.
    """
    places = np.flatnonzero(free & np.isfinite(one.contact_kpa.sigma) & (one.contact_kpa.sigma > 0))
    if not len(places):
        raise AnalysisError(
            f"the map has a pressure at none of the {int(free.sum())} places that are free",
            "name places with targets where nothing touches the wall",
        )
    value, sigma = (part[places] for part in one.contact_kpa)
    weight = sigma**-2 / (sigma**-2).sum()
    residual, spread = float(weight @ value), float(weight @ sigma)
    ratio = value / sigma
    worst, misfit = int(np.argmax(np.abs(ratio))), float((ratio**2).mean())
    return FreeWall(
        residual_kpa=Estimate(np.array(residual), np.array(spread)),
        misfit=misfit,
        worst=(int(places[worst]), float(ratio[worst])),
        agrees=abs(residual) <= limit * spread and misfit**0.5 <= limit,
    )


def _ratio(one: PressureMap) -> Array:
    ratio: Array = np.where(one.usable, one.contact_kpa.value / one.contact_kpa.sigma, -np.inf)
    return ratio


def _difference(value: Array, variance: Array) -> Estimate:
    return Estimate(value, np.where(np.isfinite(value), np.sqrt(variance), np.nan))
