"""Blobs of one view as reconstruction uses them: positions and their uncertainty."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError


@dataclass(frozen=True, slots=True, eq=False)
class ViewBlobs:
    """N blobs of one view.

    Attributes:
        xy_px: (N, 2) float64, frame pixels.
        sigma_px: (N, 2) float64, above 0: standard deviation of `xy_px` from location alone, without line
            jitter.
        common_px: (N,) float64, standard deviation of the error in x shared by blobs on the same lines in
            both views; None takes it from the line jitter of `ImageNoise`.
        common_reach_px: Distance in frame lines over which its correlation falls to e^−½.

    Raises:
        MeasurementError: A position or standard deviation is not finite, or a standard deviation is not above
            0.
    """

    xy_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    common_px: NDArray[np.float64] | None = None
    common_reach_px: float = 0.0

    def __post_init__(self) -> None:
        # The minimum, and the sum of squares, are NaN if any value is.
        least_px = np.minimum.reduce(self.sigma_px, axis=None, initial=np.inf)
        if not (least_px > 0.0 and math.isfinite(np.vdot(self.xy_px, self.xy_px))):
            raise MeasurementError(
                f"some of {len(self)} blobs have no position, or no standard deviation above 0",
                "this is a bug in the location method: choose another, and report it",
            )

    def __len__(self) -> int:
        return len(self.xy_px)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "ViewBlobs":
        """Select blobs by a mask or index array."""
        common_px = None if self.common_px is None else self.common_px[chosen]
        return ViewBlobs(self.xy_px[chosen], self.sigma_px[chosen], common_px, self.common_reach_px)
