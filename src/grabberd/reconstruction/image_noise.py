"""The covariance of a target's four image coordinates: pointing, and the jitter that both views share."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, linearise
from grabberd.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]

_JITTER_OF_A_BLOB = 0.735
"""σ of a centroid's x per σ of its lines' shifts, times √(line pitch / radius): chords weigh by length."""


@dataclass(frozen=True, slots=True)
class ImageNoise:
    """What blurs the image coordinates beside the pointing.

    Attributes:
        jitter_px: standard deviation of a line's shift, one for the whole line and so for both views.
        y_step: frame lines from row to row: 2 intact, 1 doubled.
        radius_lines: radius of a target's image in frame lines.
    """

    jitter_px: float
    y_step: int
    radius_lines: float

    @classmethod
    def of(cls, rig: Rig, model: ObjectModel, jitter_px: float, y_step: int) -> "ImageNoise":
        """The noise of this object before this rig: the radius at the middle of the object, seen face on."""
        _, slopes = linearise(rig, model.xyz_mm.mean(axis=0, keepdims=True))
        lines_per_mm = float(np.sqrt((slopes[1] ** 2).sum(axis=1)).mean())
        return cls(jitter_px, y_step, 0.5 * model.target_diameter_mm * lines_per_mm)

    @property
    def blob_jitter_px(self) -> float:
        """Standard deviation that line jitter alone gives a blob's x."""
        return _JITTER_OF_A_BLOB * self.jitter_px * math.sqrt(self.y_step / self.radius_lines)

    def expected(self, lines: Array) -> "Common":
        """What blobs on these frame lines (2, N) share while nobody has solved for the shifts."""
        overlap = np.maximum(1.0 - np.abs(lines[0] - lines[1]) / (2.0 * self.radius_lines), 0.0)
        return Common(np.full_like(lines, self.blob_jitter_px), overlap)

    def whitening(self, lines: Array, sigma_px: Array, common: "Common | None" = None) -> "Whitening":
        """The transformation that makes the four coordinates uncorrelated with unit weight.

        Args:
            lines: (2, N) y of the blobs in frame lines: left, right.
            sigma_px: (2, 2, N) pointing of x and y (first axis) in the left and the right view (second).
            common: what line jitter leaves in x, where that is known better than `expected`.
        """
        sigma, overlap = common or self.expected(lines)
        scale = np.empty_like(sigma_px)
        np.divide(1.0, sigma_px[1], out=scale[1])
        variance = sigma_px[0] * sigma_px[0] + sigma * sigma
        shared = sigma[0] * sigma[1] * overlap
        np.divide(1.0, np.sqrt(variance[0]), out=scale[0, 0])
        mixed = shared * scale[0, 0]
        np.divide(1.0, np.sqrt(variance[1] - mixed * mixed), out=scale[0, 1])
        return Whitening(scale, mixed * scale[0, 1])


class Common(NamedTuple):
    """The error in x that both blobs of a target may share, since they lie on the same lines.

    Attributes:
        sigma_px: (2, N) its standard deviation in the left and the right view.
        overlap: (N,) correlation of the two.
    """

    sigma_px: Array
    overlap: Array

    @classmethod
    def of(cls, sigma_px: Array, lines: Array, reach_px: float) -> "Common":
        """Of blobs on these frame lines (2, N), the correlation falling to e^−½ over the reach."""
        return cls(sigma_px, np.exp(-0.5 * ((lines[0] - lines[1]) / reach_px) ** 2))


class Whitening(NamedTuple):
    """Inverse of the Cholesky factor of N covariances, of which only x left and x right correlate.

    Attributes:
        scale: (2, 2, N): coordinate, view.
        mixed: (N,) what the whitened x of the left view takes from that of the right.
    """

    scale: Array
    mixed: Array

    def of_values(self, values: Array) -> Array:
        """(2, 2, N) values, whitened."""
        white = values * self.scale
        white[0, 1] -= self.mixed * white[0, 0]
        return white

    def of_slopes(self, slopes: Array) -> Array:
        """(2, 2, K, N) derivatives of the values, whitened."""
        white = slopes * self.scale[:, :, np.newaxis]
        white[0, 1] -= self.mixed * white[0, 0]
        return white
