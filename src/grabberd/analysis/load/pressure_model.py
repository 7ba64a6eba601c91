"""From a field's points to the pressure on the teat, by the wall's equilibrium."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.grid import Grid
from grabberd.analysis.load.load_fit import Posterior
from grabberd.analysis.load.load_prior import Difference, LoadPrior, TubePrior
from grabberd.analysis.load.load_series import LoadSeries
from grabberd.analysis.load.mounting import Mounting
from grabberd.analysis.load.pressure import ChamberVacuum, PressureMap
from grabberd.analysis.load.wall_model import WallModel
from grabberd.analysis.wall.material import Material, Zone
from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

Array = NDArray[np.float64]

MISFIT_ALARM = 2.0
"""Misfit above which points and wall contradict each other."""
_EXACT = 1e-4
"""σ in kPa of a pressure difference that is given as exact."""
_FAR = "no targets near enough"


class PressureModel:
    """Common part of a capture's pressure maps: the mounted wall, and the states it has been in."""

    def __init__(
        self, grid: Grid, zones: Sequence[Zone], reference: Points | None, sought_kpa: float
    ) -> None:
        """Mounts the liner.

        Args:
            grid: targets of the object model.
            zones: material of the wall; one for all of it.
            reference: targets of the open liner; None for the object model's.
            sought_kpa: smallest pressure that the map has to resolve; if σ exceeds both this and the pressure,
                the target has no pressure.

        Raises:
            AnalysisError: the inputs make no wall whose equilibrium can be computed.
        """
        material = _material(zones)
        self._grid, self._sought_kpa = grid, sought_kpa
        self._mounting = Mounting.of(grid, material, reference)
        self._model = WallModel(
            self._mounting.half, self._mounting.targets, LoadPrior(), TubePrior.of(material)
        )
        self._series = LoadSeries(self._model)

    def map(self, points: Points, within: NDArray[np.bool_], vacuum: ChamberVacuum) -> PressureMap:
        """The pressure at one field.

        Args:
            points: of the field.
            within: (N,) True for targets that are supported by data.
            vacuum: at the field.

        Raises:
            AnalysisError: the wall has no equilibrium with these points.
        """
        difference = Difference(vacuum.difference_kpa, max(vacuum.difference_sigma_kpa, _EXACT))
        found = self._series.load(self._mounting.sights(points, self._grid), difference)
        value, covariance = found.contact_kpa(self._model.targets)
        contact = Estimate(value, np.sqrt(np.diagonal(covariance)))
        # The liner's vacuum is in the difference as well, where its error partly cancels: never too small.
        above = Estimate(value - vacuum.liner_kpa, np.hypot(contact.sigma, vacuum.liner_sigma_kpa))
        return PressureMap(contact, covariance, above, found.j, self._reasons(contact, within, found))

    def _reasons(self, contact: Estimate, within: NDArray[np.bool_], found: Posterior) -> tuple[str, ...]:
        """The first applicable reason why each target has no pressure; empty if it has one."""
        if found.j > MISFIT_ALARM:
            said = f"points and the wall's equilibrium contradict each other (misfit {found.j:.1f}, usual .3 to 1.2)"
            return (said,) * len(within)
        least = np.maximum(contact.value, self._sought_kpa)
        vague = [
            f"σ of {sigma:.2g} kPa exceeds the pressure sought ({wanted:.2g} kPa)"
            for sigma, wanted in zip(contact.sigma, least, strict=True)
        ]
        reasons = np.select([~within, contact.sigma > least], [_FAR, np.array(vague)], "")
        return tuple(map(str, reasons))


def _material(zones: Sequence[Zone]) -> Material:
    if len(zones) != 1:
        raise AnalysisError(
            f"the wall's equilibrium needs one material for the whole liner, not {len(zones)} zones",
            "give one material for a map of the pressure",
        )
    return zones[0].material
