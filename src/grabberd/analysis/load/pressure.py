"""The liner's pressure on the teat as a map, with the contributions to its σ."""

import re
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

_VALUES = re.compile(r" of \S+ kPa| \([^)]*\)")
"""Parts of a reason that differ from target to target."""


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


class Shares(NamedTuple):
    """Contributions to σ_p at N places; a signed one is the effect of one σ of a cause common to all.

    Attributes:
        points_kpa: (N,) from the points, independent from field to field, and from those of the reference.
        pulsation_kpa: (N,) signed, from the pulsation chamber's vacuum; `liner_kpa`: the liner's.
        time_kpa: (N,) signed, from the offset between the clocks.
        material_kpa: (3, N) signed, from E, wall and F0 (`VARIED`).
    """

    points_kpa: Array
    pulsation_kpa: Array
    liner_kpa: Array
    time_kpa: Array
    material_kpa: Array

    @property
    def common_kpa(self) -> Array:
        """(6, N) all signed shares."""
        return np.concatenate([[self.pulsation_kpa, self.liner_kpa, self.time_kpa], self.material_kpa])

    @property
    def sigma_kpa(self) -> Array:
        """(N,) σ from all shares."""
        result: Array = np.sqrt(self.points_kpa**2 + (self.common_kpa**2).sum(axis=0))
        return result


class PressureMap(NamedTuple):
    """The pressure at N places of the wall at one field.

    Attributes:
        u_mm: (N,) material coordinates; `v_mm`: (N,).
        contact_kpa: (N,) p_contact on the inner face, above the pressure in the liner.
        overpressure_kpa: (N,) the same above atmosphere: the load on the teat, in phase d the overpressure.
        wall_kpa: (N,) T:κ − ∇∇:M, inward pressure of the wall itself, on the middle surface.
        shares: contributions to the σ of `contact_kpa`.
        reason: (N,) reason why a target has no pressure; empty if it has one.
    """

    u_mm: Array
    v_mm: Array
    contact_kpa: Estimate
    overpressure_kpa: Estimate
    wall_kpa: Array
    shares: Shares
    reason: tuple[str, ...]

    @property
    def usable(self) -> NDArray[np.bool_]:
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
