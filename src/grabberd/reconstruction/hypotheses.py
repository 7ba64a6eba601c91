"""Which pairs of blobs may be which targets: what the rays and the object model allow, before anything is decided."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, approach, linearise, rays
from grabberd.reconstruction.image_noise import ImageNoise
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Hypotheses(NamedTuple):
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
        return Hypotheses(*(values[chosen] for values in self))


def candidates(rig: Rig, left: ViewBlobs, right: ViewBlobs, gate: float) -> tuple[Indices, Indices]:
    """The pairs of blobs whose rays pass each other within `gate` standard deviations, by ascending left blob.

    Returns:
        (C,) indices of the left and of the right blobs.
    """
    left_view, right_view = rig.views
    left_center, from_left = rays(left_view, left.xy_px)
    right_center, from_right = rays(right_view, right.xy_px)
    met = approach(left_center, from_left[:, np.newaxis], right_center, from_right[np.newaxis])
    lines = np.hypot(left.sigma_px[:, np.newaxis, 1], right.sigma_px[:, 1])
    pairs = np.nonzero(np.abs(met.distance_mm) <= gate * lines * _line_mm(rig, met.middle_mm))
    return pairs[0], pairs[1]


def hypotheses(
    rig: Rig,
    model: ObjectModel,
    blobs: tuple[ViewBlobs, ViewBlobs],
    noise: ImageNoise,
    gate: float,
    farthest_mm: float,
) -> Hypotheses:
    """Every candidate for every target that is nominally within `farthest_mm` of it.

    Args:
        rig: left and right view.
        model: the object.
        blobs: those of the left and of the right view, with all that is uncertain about them in their σ.
        noise: line jitter.
        gate: how many standard deviations rays may miss each other by.
        farthest_mm: how far a target may be from its nominal place.
    """
    left, right = candidates(rig, *blobs, gate)
    numbers = np.arange(len(left), dtype=np.int32)
    met = intersect(rig, numbers, blobs[0].select(left), blobs[1].select(right), noise)
    apart = met.xyz_mm - model.xyz_mm[:, np.newaxis]
    target, pair = np.nonzero((apart * apart).sum(axis=2) <= farthest_mm**2)
    variance = np.diagonal(met.covariance_mm2, axis1=1, axis2=2)
    return Hypotheses(target, left[pair], right[pair], apart[target, pair], variance[pair])


def _line_mm(rig: Rig, places_mm: Array) -> float:
    """Size of a frame line at the object, taken in the middle of all meeting places before both cameras."""
    center = rig.center_mm[:, :, 0].mean(axis=0)
    ...
    return 0.0
