"""What reconstruction takes of the blobs of one view: where they are, and how well that is known."""

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
        common_px: (N,) float64, standard deviation of the error in x that blobs on the same lines share in
            both views; None: as the line jitter of `ImageNoise` has it.
        common_reach_px: blobs so many frame lines apart have e^−½ of that error in common.

    Raises:
        MeasurementError: a place or a standard deviation is not a number, or a standard deviation not above
            0.
    """

    xy_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    common_px: NDArray[np.float64] | None = None
    common_reach_px: float = 0.0

    def __post_init__(self) -> None:
        # The least of numbers, and their sum of squares, are no number where one of them is none.
        least_px = np.minimum.reduce(self.sigma_px, axis=None, initial=np.inf)
        if not (least_px > 0.0 and math.isfinite(np.vdot(self.xy_px, self.xy_px))):
            raise MeasurementError(
                f"of {len(self)} blobs some have no place or no standard deviation above 0",
                "this is a fault of the location method: choose another, and report it",
            )

    def __len__(self) -> int:
        return len(self.xy_px)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "ViewBlobs":
        """The blobs that a mask or index array chooses."""
        common_px = None if self.common_px is None else self.common_px[chosen]
        return ViewBlobs(self.xy_px[chosen], self.sigma_px[chosen], common_px, self.common_reach_px)
