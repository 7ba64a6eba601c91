"""Coverage of a run: the counts of its targets and of its fields."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.miss import Miss

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

CERTAIN = 3.0
"""An offset is taken for a displacement of the target if it is more than this many of its σ."""


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """Coverage of a run's F fields and of the M targets of its object.

    Attributes:
        target: (M,) ids, ascending.
        expected: (M,) number of fields in which both views should see the target.
        misses: (M, len(Miss)) number of those fields by `Miss`; the first column counts those in which it was
            found.
        offset_mm: (M, 3) mean offset of the target from where its neighbours put it, by some of the fields;
            NaN if it was not seen in any of these.
        offset_sigma_mm: (M,) its standard deviation, in space; NaN if it is from fewer than two fields.
        looks: (M,) number of fields that it is from.
        n: (F,) numbers of the fields that were measured.
        field_expected: (F,) number of targets that both views should see.
        field_found: (F,) number of those found.
        field_residual_px: (F,) root mean square image residual; NaN without points.
        residual_px: The same over all points; NaN without points.
        residual_sigma: In units of its expected standard deviation.
    """

    target: NDArray[np.int32]
    expected: Counts
    misses: Counts
    offset_mm: Array
    offset_sigma_mm: Array
    looks: Counts
    n: Counts
    field_expected: Counts
    field_found: Counts
    field_residual_px: Array
    residual_px: float
    residual_sigma: float

    @property
    def found(self) -> Counts:
        """(M,) number of fields in which each target was found."""
        return self.misses[:, Miss.FOUND]

    @property
    def share(self) -> float:
        """Share found of all that were expected; NaN if nothing was."""
        expected = int(self.expected.sum())
        return float(self.found.sum() / expected) if expected else np.nan

    @property
    def target_share(self) -> Array:
        """(M,) share of its expected fields in which each target was found; NaN if it never was expected."""
        with np.errstate(invalid="ignore"):
            share: Array = self.found / self.expected
        return share

    @property
    def chief_miss(self) -> Counts:
        """(M,) most frequent reason why each target was not found; `Miss.FOUND` if it never was missed."""
        missed = self.misses[:, 1:]
        chief: Counts = np.where(missed.any(axis=1), missed.argmax(axis=1) + 1, int(Miss.FOUND))
        return chief

    @property
    def distance_mm(self) -> Array:
        """(M,) length of the mean offset."""
        distance: Array = np.sqrt((self.offset_mm * self.offset_mm).sum(axis=1))
        return distance

    @property
    def displaced(self) -> NDArray[np.bool_]:
        """(M,) True for targets whose offset is certain: their place in the object file is wrong."""
        displaced: NDArray[np.bool_] = self.distance_mm > CERTAIN * self.offset_sigma_mm
        return displaced
