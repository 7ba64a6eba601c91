"""The liner's pressure on the teat as a map, and its first touch: where and when the wall begins to press."""

import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.load_profile import LoadProfile
from grabberd_liner.analysis.load.wall_surfaces import MiddleSurface
from grabberd_liner.arrays import Array, Mask

_VALUES = re.compile(r" of \S+ kPa| \([^)]*\)")
"""Parts of a reason that differ from target to target."""
_TOUCHES = 3.0
"""σ from which on a pressure shows that the wall touches the teat."""


class ChamberVacuum(NamedTuple):
    """The vacuum on both sides of the wall at one field, kPa below atmosphere.

    Attributes:
        pulsation_kpa: vacuum in the pulsation chamber; `liner_kpa`: in the liner.
        pulsation_sigma_kpa: σ of `pulsation_kpa`; `liner_sigma_kpa`: σ of `liner_kpa`.
        pulsation_slope_kpa_per_s: rate of change of `pulsation_kpa`; `liner_slope_kpa_per_s`: of `liner_kpa`.
        time_sigma_s: σ of the offset between the clocks of the camera and of the vacuum.
    """

    pulsation_kpa: float
    liner_kpa: float
    pulsation_sigma_kpa: float
    liner_sigma_kpa: float
    pulsation_slope_kpa_per_s: float = 0.0
    liner_slope_kpa_per_s: float = 0.0
    time_sigma_s: float = 0.0

    @property
    def difference_kpa(self) -> float:
        """p_pulsation − p_liner."""
        return self.liner_kpa - self.pulsation_kpa

    @property
    def difference_sigma_kpa(self) -> float:
        """σ of the difference, from both gauges and from the offset between the clocks."""
        slope = self.liner_slope_kpa_per_s - self.pulsation_slope_kpa_per_s
        return float(
            np.linalg.norm([self.pulsation_sigma_kpa, self.liner_sigma_kpa, slope * self.time_sigma_s])
        )


class PressureMap(NamedTuple):
    """The pressure at N targets at one field.

    Attributes:
        contact_kpa: (N,) p_contact on the inner face, above the pressure in the liner.
        mean_kpa: mean of `contact_kpa` over the supported targets, its σ from their full covariance. Targets
            whose own pressure is too uncertain count as well: without them, it would be that of the pressed
            ones. NaN if no target has a pressure.
        above_atmosphere_kpa: (N,) the same above atmosphere: minus the vacuum in the liner.
        misfit: of points and prior by the wall in equilibrium, per measured coordinate; .3 to 1.2 is usual.
        unseen_kpa: (N,) `contact_kpa` less what it would be if the unseen half were free; None where it is.
        supported: (N,) True for targets that are supported by data.
        reason: (N,) reason why a target has no pressure of its own; empty if it has one.
        profile: the load over height, x in the object's frame; None if the wall's equilibrium says nothing
            of it. Of an empty liner it is what opposite walls press each other with.
        middle: the wall's middle surface in this state; None if points and wall contradict each other.
    """

    contact_kpa: Estimate
    mean_kpa: Estimate
    above_atmosphere_kpa: Estimate
    misfit: float
    unseen_kpa: Array | None
    supported: Mask
    reason: tuple[str, ...]
    profile: LoadProfile | None = None
    middle: MiddleSurface | None = None

    @property
    def usable(self) -> Mask:
        """(N,) True for targets with a pressure."""
        return np.array([not reason for reason in self.reason], np.bool_)

    def determined(self) -> "PressureMap":
        """The map itself.

        Raises:
            AnalysisError: no target has a pressure.
        """
        if not all(self.reason):
            return self
        kinds = Counter(_VALUES.sub("", reason) for reason in self.reason)
        most = ", or ".join(kind for kind, _ in kinds.most_common()) or "none was asked for"
        sigma = self.contact_kpa.sigma
        known = sigma[np.isfinite(sigma)]
        median = f"median σ {np.median(known):.2g} kPa" if len(known) else "no σ is a number"
        raise AnalysisError(
            f"none of {len(self.reason)} places has its pressure determined: {most} ({median})",
            "capture with more bits or a finer target grid, or average over phases",
        )


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
