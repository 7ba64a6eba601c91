"""One solved wall as an estimator is given it, and what came of it beside the truth."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.walls import SolvedLiner, pressure_map, with_noise

from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap, PressureModel

Array = NDArray[np.float64]

LINER_VACUUM_KPA = 42.0
REFERENCE_MM = np.full(3, 0.005)
"""σ of a target's place in the reference state, the mean of many fields."""
GAUGE_KPA = 0.35
"""σ of either gauge, so that the pressure difference is known to .5 kPa."""
E_SIGMA, WALL_SIGMA, F0_SIGMA = 0.035, 0.02, 0.1
"""Relative σ of modulus, thickness and pretension once a ramp with the empty liner has been evaluated."""
SOUGHT_KPA = 50.0
"""Beyond every σ: no place is refused for it, so that all are judged."""


class Given(NamedTuple):
    """How far what the estimator is told is from what is true, and the σ that it is told.

    Attributes:
        E, wall, F0: relative errors; `kpa`: of the pressure difference.
        E_sigma, wall_sigma, F0_sigma, kpa_sigma: σ of each.
    """

    E: float = 0.0
    wall: float = 0.0
    F0: float = 0.0
    kpa: float = 0.0
    E_sigma: float = E_SIGMA
    wall_sigma: float = WALL_SIGMA
    F0_sigma: float = F0_SIGMA
    kpa_sigma: float = GAUGE_KPA * np.sqrt(2.0)

    @classmethod
    def drawn(cls, random: np.random.Generator) -> "Given":
        """Errors of their own σ."""
        sure = cls()
        sigma = [sure.E_sigma, sure.wall_sigma, sure.F0_sigma, sure.kpa_sigma]
        return cls(*(random.normal(size=4) * sigma))

    def vacuum(self, outer_kpa: float) -> ChamberVacuum:
        """The vacuum as it is told where the pressure difference is `outer_kpa`."""
        gauge_kpa = self.kpa_sigma / np.sqrt(2.0)
        told_kpa = LINER_VACUUM_KPA - outer_kpa - self.kpa
        return ChamberVacuum(told_kpa, LINER_VACUUM_KPA, gauge_kpa, gauge_kpa)

    def material(self, liner: SolvedLiner) -> dict[str, float]:
        """The liner's values as they are told, for `SolvedLiner.zones`."""
        design = liner.design
        values = {
            "E_mpa": (design["young_mpa"], self.E, self.E_sigma),
            "wall_mm": (design["wall_mm"], self.wall, self.wall_sigma),
            "F0_n": (design["pretension_n"], self.F0, self.F0_sigma),
        }
        told = {name: true * (1 + error) for name, (true, error, _) in values.items()}
        sigma = {_sigma_name(name): true * sigma for name, (true, _, sigma) in values.items()}
        return told | sigma


def _sigma_name(name: str) -> str:
    quantity, unit = name.rsplit("_", 1)
    return f"{quantity}_sigma_{unit}"


class Judged(NamedTuple):
    """One map beside the truth.

    Attributes:
        error_kpa, sigma_kpa: (N,) of the contact pressure at the targets.
        mean_error_kpa, mean_sigma_kpa: of their mean.
        refused: true if no target has a pressure: points and wall contradict each other, there is no
            equilibrium, or the liner presses itself alone.
    """

    error_kpa: Array
    sigma_kpa: Array
    mean_error_kpa: float
    mean_sigma_kpa: float
    refused: bool

    @classmethod
    def of(cls, one: PressureMap, true_kpa: Array) -> "Judged":
        """A map of all targets beside the truth."""
        error = one.contact_kpa.value - true_kpa
        mean_sigma_kpa = float(one.mean_kpa.sigma)
        return cls(error, one.contact_kpa.sigma, float(error.mean()), mean_sigma_kpa, not one.usable.any())

    @classmethod
    def refusal(cls, count: int) -> "Judged":
        """No map of `count` targets."""
        none = np.full(count, np.nan)
        return cls(none, none, np.nan, np.nan, True)

    def only(self, chosen: NDArray[np.bool_]) -> "Judged":
        """The same of some targets (N,); the mean's σ remains that of all."""
        return self._replace(error_kpa=self.error_kpa[chosen], sigma_kpa=self.sigma_kpa[chosen])


class Estimator:
    """The product's pressure model of one wall, as one `Given` tells it."""

    def __init__(
        self,
        liner: SolvedLiner,
        given: Given,
        reference: Points | None,
        unseen: str = "free",
        rig: Rig | None = None,
    ) -> None:
        """Mounts the liner.

        Args:
            liner: the solved wall.
            given: what is told of it.
            reference: targets of the open liner; None for the object model's.
            unseen: what is taken for the hidden half, `free` or `mirrored`.
            rig: whose views saw the points.
        """
        self._liner = liner
        zones = liner.zones(**given.material(liner))
        self._model = PressureModel(liner.grid, zones, reference, SOUGHT_KPA, unseen, rig)

    def judged(self, points: Points, outer_kpa: float, vacuum: ChamberVacuum) -> Judged:
        """One map beside the truth at a pressure difference, with the vacuum as it is told."""
        true_kpa = self._liner.contact_kpa(outer_kpa)
        everywhere = np.ones(len(true_kpa), bool)
        try:
            one = pressure_map(self._model, points, everywhere, vacuum)
        except AnalysisError:
            return Judged.refusal(len(true_kpa))
        return Judged.of(one, true_kpa)


def reference_points(liner: SolvedLiner, random: np.random.Generator) -> Points:
    """The open liner as many fields show it."""
    return with_noise(liner, liner.places_mm(0.0), REFERENCE_MM, random)


class Figures(NamedTuple):
    """What many comparisons come to.

    Attributes:
        bias: mean error; `rms`: its root mean square; `sigma`: that of σ; `chi2`: mean of (error / σ)².
    """

    bias: float
    rms: float
    sigma: float
    chi2: float

    @classmethod
    def of(cls, error: Array, sigma: Array) -> "Figures":
        """Of errors with their σ."""
        if not len(error):
            return cls(np.nan, np.nan, np.nan, np.nan)
        return cls(
            float(error.mean()),
            float(np.sqrt(np.mean(error**2))),
            float(np.sqrt(np.mean(sigma**2))),
            float(np.mean((error / sigma) ** 2)),
        )

    @classmethod
    def of_places(cls, maps: Iterable[Judged]) -> "Figures":
        """Of all places of the maps that were not refused."""
        kept = [one for one in maps if not one.refused]
        return cls.of(
            np.concatenate([one.error_kpa for one in kept] or [np.empty(0)]),
            np.concatenate([one.sigma_kpa for one in kept] or [np.empty(0)]),
        )

    @classmethod
    def of_means(cls, maps: Iterable[Judged]) -> "Figures":
        """Of the means over the seen part, of the maps that were not refused."""
        kept = [one for one in maps if not one.refused]
        return cls.of(
            np.array([one.mean_error_kpa for one in kept]), np.array([one.mean_sigma_kpa for one in kept])
        )

    def text(self) -> str:
        """RMS / σ (χ²), "none" where there is nothing to compare."""
        return f"{self.rms:.1f} / {self.sigma:.1f} ({self.chi2:.2f})" if np.isfinite(self.rms) else "none"


def refused_text(maps: Sequence[Judged]) -> str:
    """The share of maps that were refused, in %."""
    return f"{100 * np.mean([one.refused for one in maps]):.0f} %" if maps else "none"


def paragraph(*parts: str) -> str:
    """One paragraph of Markdown in lines of some length."""
    return textwrap.fill(" ".join(parts), 100)
