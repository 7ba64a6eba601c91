"""Check length: a certified distance between two targets that took no part in the adjustment.

The adjustment takes its scale from the calibration frame's file alone, so a file that is two per cent too
large makes a rig that is two per cent too large, with perfect residuals. Only another length tells.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.calibration.adjustment.propagation import intersect_network, propagate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CheckLength:
    """A certified length between the centres of two targets, by their ids."""

    first: int
    second: int
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True, slots=True)
class MeasuredLength:
    """A check length as the calibration measures it.

    Attributes:
        check: The certified length.
        measured_mm: The distance of the points intersected from both views' images of the targets.
        sigma_mm: σ of the difference: of the images, of the calibration, and of the certificate.
    """

    check: CheckLength
    measured_mm: float
    sigma_mm: float

    @property
    def difference_mm(self) -> float:
        """Measured minus certified."""
        return self.measured_mm - self.check.length_mm

    @property
    def scale_percent(self) -> float:
        """Error of the scale."""
        return 100 * self.difference_mm / self.check.length_mm


def measured_length(
    adjustment: Adjustment, check: CheckLength, first: int, second: int
) -> MeasuredLength | None:
    """Measure a check length; None if not both views have kept both targets.

    Args:
        adjustment: The final adjustment.
        check: The certified length.
        first: Index of its first target.
        second: Index of its second target.
    """
    network = adjustment.network
    wanted = np.array([first, second])
    images = np.isin(network.target, wanted)
    seen = [np.sum(images & (network.target == one)) for one in wanted]
    if min(seen) < len(adjustment.views):
        return None
    chosen = network.select(images)
    pair = replace(
        chosen.starting_from(adjustment.views),
        target=np.searchsorted(np.sort(wanted), chosen.target),
        target_mm=adjustment.xyz_mm[np.sort(wanted)],
        target_sigma_mm=np.full((2, 3), np.inf),
        ids=None,
    )
    places = intersect_network(pair)
    along = places[1] - places[0]
    length = float(np.linalg.norm(along))
    spread = propagate(replace(pair, target_mm=places), adjustment.parameter_covariance)
    unit = along / length
    pointing = float(np.einsum("i,nij,j->", unit, spread.pointing_mm2, unit))
    # The rig's own error is common to both ends: what counts is its influence on their difference.
    influence = unit @ (spread.influence[1] - spread.influence[0])
    rig = float(influence @ adjustment.parameter_covariance @ influence)
    return MeasuredLength(check, length, float(np.sqrt(pointing + rig + check.sigma_mm**2)))
