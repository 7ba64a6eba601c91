"""The load in state after state of a capture, most of them by a model that was linearised before.

A linearised model holds for about a millimetre round its state: there it gives the load to a tenth of its σ
in a hundredth of the time. A cycle passes through some dozen such states, again and again, so the capture's
length hardly counts. Loads are best sought in the order of the wall's departure, from state to state nearby.
"""

import numpy as np

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.load_fit import MISFIT_ALARM, Posterior, Response, fit_load, posterior
from grabberd_liner.analysis.load.load_prior import Difference
from grabberd_liner.analysis.load.mounted.sights import Sights
from grabberd_liner.analysis.load.wall_model import WallModel

REACH_MM = 0.8
"""Movement of the wall within which a linearised model holds: at 1 mm contact pressures err by up to .2 σ."""
_MOST = 2
"""Linearised models kept, of 24 MB each: enough for states in the order of the wall's departure."""


class LoadSeries:
    """The loads of one wall.

    Attributes:
        model: the wall's.
    """

    def __init__(self, model: WallModel) -> None:
        """Begins without any state."""
        self.model = model
        self._known: list[Response] = []

    def load(self, sights: Sights, difference: Difference) -> Posterior:
        """The load in one state.

        Raises:
            AnalysisError: the wall does not settle.
        """
        found = self._near_known(sights, difference)
        if found is None or found.j > MISFIT_ALARM:
            begun = self._begun(sights, difference)
            if found is None or begun.j < found.j:
                found = begun
        if not any(found.response is known for known in self._known):
            self._known = [*self._known[1 - _MOST :], found.response]
        return found

    def _near_known(self, sights: Sights, difference: Difference) -> Posterior | None:
        """The load, sought from the nearest state that is known; None if it is not found from there."""
        if not self._known:
            return None
        try:
            found = posterior(self._nearest(sights), sights, difference)
            if found.longest_mm < REACH_MM:
                return found
            return fit_load(self.model, sights, difference, found.moved(REACH_MM / found.longest_mm))[0]
        except AnalysisError:
            return None  # the open wall is a safer start, and decides whether there is a load at all

    def _begun(self, sights: Sights, difference: Difference) -> Posterior:
        """The load, sought from the open wall; first by the targets that both views see.

        From afar, a ray that a target may slide along leads into a wrong fold.
        """
        of_points = sights.of_both_views()
        found, _ = fit_load(self.model, of_points, difference)
        if len(of_points) == len(sights):
            return found
        return fit_load(self.model, sights, difference, found.moved())[0]

    def _nearest(self, sights: Sights) -> Response:
        places_mm = np.stack([one.linear.places_mm.ravel() for one in self._known])
        away = np.abs(sights.value - sights.of_places(places_mm)).max(axis=1)
        return self._known[int(np.argmin(away))]
