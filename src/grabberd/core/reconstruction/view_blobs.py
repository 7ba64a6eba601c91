"""Blobs of one view as reconstruction uses them, and the image noise: the covariance of a target's four image
coordinates, from pointing and the shared line jitter.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, linearise
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]
_JITTER_OF_A_BLOB = 0.735
"""σ of a centroid's x per σ of its lines' shifts, times √(line pitch / radius): chords weigh by length."""


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


@dataclass(frozen=True, slots=True)
class ImageNoise:
    """Errors of image coordinates other than pointing.

    Attributes:
        jitter_px: Standard deviation of a line's shift, common to the whole line and so to both views.
        y_step: Frame lines from row to row: 2 intact, 1 doubled.
        radius_lines: Radius of a target's image in frame lines.
    """

    jitter_px: float
    y_step: int
    radius_lines: float

    @classmethod
    def of(
        cls, rig: Rig, model: ObjectModel, jitter_px: float, y_step: int, lines_apart: int = 2
    ) -> "ImageNoise":
        """Noise of an object seen by a rig, with the radius at the middle of the object, seen face on.

        Lines of progressive pictures, which are one frame line apart, do not shift.
        """
        jitter_px = 0.0 if lines_apart == 1 else jitter_px
        _, slopes = linearise(rig, model.xyz_mm.mean(axis=0, keepdims=True))
        lines_per_mm = float(np.sqrt((slopes[1] ** 2).sum(axis=1)).mean())
        return cls(jitter_px, y_step, 0.5 * model.target_diameter_mm * lines_per_mm)

    @property
    def blob_jitter_px(self) -> float:
        """Standard deviation of a blob's x from line jitter alone."""
        return _JITTER_OF_A_BLOB * self.jitter_px * math.sqrt(self.y_step / self.radius_lines)

    def expected(self, lines: Array) -> "Common":
        """Error shared by blobs on frame lines (2, N) if the shifts have not been solved for."""
        overlap = np.maximum(1.0 - np.abs(lines[0] - lines[1]) / (2.0 * self.radius_lines), 0.0)
        return Common(np.full_like(lines, self.blob_jitter_px), overlap)

    def whitening(self, lines: Array, sigma_px: Array, common: "Common | None" = None) -> "Whitening":
        """Make the transformation to four uncorrelated coordinates of unit weight.

        Args:
            lines: (2, N) y of the blobs in frame lines: left, right.
            sigma_px: (2, 2, N) pointing σ of x and y (first axis) in the left and right view (second).
            common: Error of line jitter in x, if known better than by `expected`.
        """
        sigma, overlap = common or self.expected(lines)
        # Cholesky by hand: only the two x correlate, so the factor has a single element off its diagonal.
        scale = np.empty_like(sigma_px)
        np.divide(1.0, sigma_px[1], out=scale[1])
        variance = sigma_px[0] * sigma_px[0] + sigma * sigma
        # Both x share the shifts of their lines: taken as independent, σ of Z comes out half too large.
        shared = sigma[0] * sigma[1] * overlap
        np.divide(1.0, np.sqrt(variance[0]), out=scale[0, 0])
        mixed = shared * scale[0, 0]
        np.divide(1.0, np.sqrt(variance[1] - mixed * mixed), out=scale[0, 1])
        return Whitening(scale, mixed * scale[0, 1])


class Common(NamedTuple):
    """Error in x shared by both blobs of a target, since they lie on the same lines.

    Attributes:
        sigma_px: (2, N) its standard deviation in the left and right view.
        overlap: (N,) correlation of the two.
    """

    sigma_px: Array
    overlap: Array

    @classmethod
    def of(cls, sigma_px: Array, lines: Array, reach_px: float) -> "Common":
        """Make it for blobs on frame lines (2, N), with a correlation that falls to e^−½ over the reach."""
        return cls(sigma_px, np.exp(-0.5 * ((lines[0] - lines[1]) / reach_px) ** 2))


class Whitening(NamedTuple):
    """Inverse Cholesky factors of N covariances in which only the left and the right x correlate.

    Attributes:
        scale: (2, 2, N): coordinate, view.
        mixed: (N,) share of the left view's whitened x subtracted from the right view's.
    """

    scale: Array
    mixed: Array

    def of_values(self, values: Array) -> Array:
        """Whiten values (2, 2, N)."""
        white = values * self.scale
        white[0, 1] -= self.mixed * white[0, 0]
        return white

    def of_slopes(self, slopes: Array) -> Array:
        """Whiten derivatives of values (2, 2, K, N)."""
        white = slopes * self.scale[:, :, np.newaxis]
        white[0, 1] -= self.mixed * white[0, 0]
        return white
