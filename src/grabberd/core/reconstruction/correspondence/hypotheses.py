"""Hypotheses: pairs of blobs that may be a target, as far as rays and object model allow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, approach, rays
from grabberd.core.reconstruction.correspondence.settings import CorrespondenceSettings
from grabberd.core.reconstruction.intersection import intersect
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.view_blobs import ImageNoise, ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """H hypotheses, by ascending target: a left and a right blob are the images of a target.

    Attributes:
        target: (H,) indices into the object model.
        left: (H,) indices of blobs in the left view.
        right: (H,) indices of blobs in the right view.
        displacement_mm: (H, 3) meeting point of the blobs' rays, relative to the target's nominal position.
        variance_mm2: (H, 3) variance of that point in X, Y and Z.
    """

    target: Indices
    left: Indices
    right: Indices
    displacement_mm: Array
    variance_mm2: Array

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: NDArray[np.bool_] | Indices) -> "Hypotheses":
        """Select hypotheses by a mask or index array."""
        return Hypotheses(
            self.target[chosen],
            self.left[chosen],
            self.right[chosen],
            self.displacement_mm[chosen],
            self.variance_mm2[chosen],
        )


def hypotheses(
    rig: Rig,
    model: ObjectModel,
    blobs: tuple[ViewBlobs, ViewBlobs],
    noise: ImageNoise,
    settings: CorrespondenceSettings,
) -> Hypotheses:
    """List every pair of blobs whose rays meet, for every target nominally near their meeting point.

    Args:
        rig: Left and right view.
        model: The object.
        blobs: Blobs of the left and the right view, with all their uncertainty in σ.
        noise: Line jitter, and the scale at the object.
        settings: Greatest distance between rays, and of a target from its nominal position.
    """
    # Every pair that meets: on a regular grid the rays alone leave only 16 of 108 pairs without a rival.
    left, right = _pairs(rig, *blobs, settings.gate * line_mm(model, noise))
    number = np.arange(len(left), dtype=np.int32)
    met = intersect(rig, number, blobs[0].select(left), blobs[1].select(right), noise)
    apart = met.xyz_mm - model.xyz_mm[:, np.newaxis]
    target, pair = np.nonzero((apart * apart).sum(axis=2) <= settings.farthest_mm**2)
    variance = np.diagonal(met.covariance_mm2, axis1=1, axis2=2)
    return Hypotheses(target, left[pair], right[pair], apart[target, pair], variance[pair])


def line_mm(model: ObjectModel, noise: ImageNoise) -> float:
    """Size of a frame line at the object."""
    return 0.5 * model.target_diameter_mm / noise.radius_lines


def meeting_share(rig: Rig, blobs: tuple[ViewBlobs, ViewBlobs], gate_mm: float) -> float:
    """Share of the blobs of the view with fewer whose rays meet any of the other view.

    Args:
        rig: Left and right view.
        blobs: Blobs of the left and the right view, with all their uncertainty in σ.
        gate_mm: Greatest distance of two rays, per pixel of σ in y.
    """
    few = int(len(blobs[1]) < len(blobs[0]))
    own = _pairs(rig, *blobs, gate_mm)[few]
    return len(np.unique(own)) / max(len(blobs[few]), 1)


def _pairs(rig: Rig, left: ViewBlobs, right: ViewBlobs, gate_mm: float) -> tuple[Indices, Indices]:
    """Indices of pairs whose rays pass each other within `gate_mm` per pixel of σ in y."""
    left_center, from_left = rays(rig.views[0], left.xy_px)
    right_center, from_right = rays(rig.views[1], right.xy_px)
    met = approach(left_center, from_left[:, np.newaxis], right_center, from_right)
    sigma_px = np.hypot(left.sigma_px[:, np.newaxis, 1], right.sigma_px[:, 1])
    in_left, in_right = np.nonzero(np.abs(met.distance_mm) <= gate_mm * sigma_px)
    return in_left, in_right
