"""Mean offsets of targets from the places where their neighbours put them, from a few fields of a run."""

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.correspondence.agreement import Sighting
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Mask = NDArray[np.bool_]

_REACH = 0.5
"""Share of the pitch within which blobs are sought: beyond, they belong to a neighbour."""


class Offsets:
    """Sums over M targets.

    Attributes:
        looks: (M,) number of fields looked at in which a target was seen, on its place or off it.
    """

    def __init__(self, count: int) -> None:
        self.looks = np.zeros(count, np.int64)
        self._missed, self._off_place = np.zeros((2, count), np.int64)
        self._sum_mm, self._square_mm2 = np.zeros((count, 3)), np.zeros(count)

    def look(
        self,
        sighting: Sighting,
        missed: Mask,
        blobs: tuple[ViewBlobs, ViewBlobs],
        correspondence: Correspondence,
    ) -> None:
        """Add a field: its targets, and those missed ones of which both views show a blob further off."""
        places_mm, _ = correspondence.expected_places(sighting.expected)
        self._missed += missed
        target, off_mm = sighting.target, sighting.points.xyz_mm - places_mm[sighting.target]
        if missed.any():
            further, xyz_mm = self._further(places_mm, missed, blobs, correspondence)
            self._off_place[further] += 1
            target = np.append(target, further)
            off_mm = np.concatenate([off_mm, xyz_mm - places_mm[further]])
        self.looks[target] += 1
        self._sum_mm[target] += off_mm
        self._square_mm2[target] += (off_mm * off_mm).sum(axis=1)

    @staticmethod
    def _further(
        places_mm: Array, missed: Mask, blobs: tuple[ViewBlobs, ViewBlobs], correspondence: Correspondence
    ) -> tuple[NDArray[np.intp], Array]:
        agreement = correspondence.agreement
        wide_mm = min(_REACH * agreement.pitch_mm, agreement.settings.farthest_mm) / agreement.settings.gate
        target, xyz_mm = correspondence.meeting(places_mm, np.full(len(places_mm), wide_mm), *blobs)
        among = missed[target]
        return target[among], xyz_mm[among]

    @property
    def off_place(self) -> Mask:
        """(M,) True for targets that mostly were off their place where they were missed."""
        return (self._off_place > 0) & (2 * self._off_place >= self._missed)

    @property
    def mean_mm(self) -> Array:
        """(M, 3) mean offsets; NaN for targets that were never seen."""
        with np.errstate(invalid="ignore", divide="ignore"):
            mean: Array = self._sum_mm / self.looks[:, np.newaxis]
        return mean

    @property
    def sigma_mm(self) -> Array:
        """(M,) standard deviations of the means in space, from their scatter; NaN below two looks."""
        mean = self.mean_mm
        with np.errstate(invalid="ignore", divide="ignore"):
            scatter = self._square_mm2 / self.looks - (mean * mean).sum(axis=1)
            variance = scatter.clip(0.0) / (self.looks - 1)
        return np.sqrt(np.where(self.looks > 1, variance, np.nan))
