"""Which pairs of blobs may be which targets: what rays and object model allow, before anything is decided."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, approach, rays
from grabberd.reconstruction.image_noise import ImageNoise
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """H hypotheses, by ascending target: this blob on the left and that on the right are this target.

    Attributes:
        target: (H,) indices into the object model.
        left: (H,) indices of blobs in the left view; `right` in the right one.
        displacement_mm: (H, 3) where the blobs' rays meet, against the target's nominal place.
        variance_mm2: (H, 3) of that place in X, Y and Z.
    """

    target: Indices
    left: Indices
    right: Indices
    displacement_mm: Array
    variance_mm2: Array

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: NDArray[np.bool_] | Indices) -> "Hypotheses":
        """The hypotheses that a mask or index array chooses."""
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
    gate: float,
    farthest_mm: float,
) -> Hypotheses:
    """Every pair of blobs whose rays meet, for every target that is nominally near their meeting place.

    Args:
        rig: left and right view.
        model: the object.
        blobs: those of the left and of the right view, with all that is uncertain about them in their σ.
        noise: line jitter, and the scale at the object.
        gate: by how many standard deviations rays may miss each other.
        farthest_mm: how far a target may be from its nominal place.
    """
    line_mm = 0.5 * model.target_diameter_mm / noise.radius_lines
    left, right = _pairs(rig, *blobs, gate * line_mm)
    number = np.arange(len(left), dtype=np.int32)
    met = intersect(rig, number, blobs[0].select(left), blobs[1].select(right), noise)
    apart = met.xyz_mm - model.xyz_mm[:, np.newaxis]
    target, pair = np.nonzero((apart * apart).sum(axis=2) <= farthest_mm**2)
    variance = np.diagonal(met.covariance_mm2, axis1=1, axis2=2)
    return Hypotheses(target, left[pair], right[pair], apart[target, pair], variance[pair])


def _pairs(rig: Rig, left: ViewBlobs, right: ViewBlobs, gate_mm: float) -> tuple[Indices, Indices]:
    """Indices of the pairs whose rays pass each other within `gate_mm` per pixel of σ in y."""
    left_center, from_left = rays(rig.views[0], left.xy_px)
    right_center, from_right = rays(rig.views[1], right.xy_px)
    met = approach(left_center, from_left[:, np.newaxis], right_center, from_right)
    sigma_px = np.hypot(left.sigma_px[:, np.newaxis, 1], right.sigma_px[:, 1])
    in_left, in_right = np.nonzero(np.abs(met.distance_mm) <= gate_mm * sigma_px)
    return in_left, in_right
