"""Points: positions of targets in space at one field."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class SingleViewImages:
    """Images of N targets that one view alone sees in a field, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        view: (N,) the view that sees each, 0 left, 1 right.
        image_px: (N, 2) float64, frame pixels x and y, corrected by the view's local field if it has one.
        sigma_px: (N, 2) float64, their standard deviation, line jitter included.
    """

    target: NDArray[np.int32]
    view: NDArray[np.intp]
    image_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.target)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """N points of one field, in the object's frame, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        xyz_mm: (N, 3) float64.
        covariance_mm2: (N, 3, 3) float64, from pointing and line jitter: independent from field to field.
        calibration_covariance_mm2: (N, 3, 3) float64, from the calibration: common to all fields and not
            reduced by averaging, hence kept separate.
        image_px: (N, 2, 2) float64, frame pixels of the blobs it was intersected from: [point, view, (x, y)],
            view 0 left, 1 right; corrected by the views' local fields if the calibration has them.
        residual_px: (N,) float64, root mean square of the four image residuals after intersection.
        single: images of further targets, which one view alone sees; None if they have not been sought.
    """

    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    calibration_covariance_mm2: NDArray[np.float64]
    image_px: NDArray[np.float64]
    residual_px: NDArray[np.float64]
    single: SingleViewImages | None = None

    @classmethod
    def joined(cls, parts: Sequence["Points"]) -> "Points":
        """Join the points of some fields, in order and without their single views."""

        def all_of(name: str) -> NDArray[Any]:
            return np.concatenate([getattr(one, name) for one in parts])

        return cls(
            all_of("target"),
            all_of("xyz_mm"),
            all_of("covariance_mm2"),
            all_of("calibration_covariance_mm2"),
            all_of("image_px"),
            all_of("residual_px"),
        )

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Points":
        """Select points by a mask or ascending index array."""
        return Points(
            self.target[chosen],
            self.xyz_mm[chosen],
            self.covariance_mm2[chosen],
            self.calibration_covariance_mm2[chosen],
            self.image_px[chosen],
            self.residual_px[chosen],
            self.single,
        )

    @classmethod
    def none(cls) -> "Points":
        """Make an empty set of points."""
        return cls(
            np.empty(0, np.int32),
            np.empty((0, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 2, 2)),
            np.empty(0),
        )
