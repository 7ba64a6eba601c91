"""Which blob of the left view, and which of the right, is which target (paper 3.7: identification by prior knowledge).

On a regular grid the epipolar geometry alone is ambiguous, so the object model decides: pairs of blobs whose rays
meet near the object are *candidates*; a candidate taken for a target near it is a *hypothesis*. From the surest one
the identification grows over the object: whoever has been identified says where the others must be, and how surely,
because neighbours move alike. What stays doubtful is left out; a wrong target is worse than a missing one.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, approach, rays
from grabberd.reconstruction.displacement import DisplacementField, Smoothness
from grabberd.reconstruction.image_noise import ImageNoise
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CorrespondenceSettings:
    """What is believed, and how surely.

    Attributes:
        farthest_mm: no target is farther than this from its nominal place.
        gate: a place is believed within this many standard deviations.
        margin: the next best hypothesis must be worse by this much, as a difference of χ².
        trust_mm: a target is identified only where its neighbours predict it better than this; a small part of the
            targets' pitch.
        stretch: neighbours' distances differ from nominal by no more than this share.
        unmodelled_px: what the calibration does not know of the picture (local errors of the mirrors).
        smoothness: of the object's deformation.
    """

    farthest_mm: float = 9.0
    gate: float = 4.0
    margin: float = 6.0
    trust_mm: float = 1.3
    stretch: float = 0.35
    unmodelled_px: float = 0.1
    smoothness: Smoothness = field(default_factory=Smoothness)


class Matches(NamedTuple):
    """K identified targets, by ascending target.

    Attributes:
        target: (K,) indices into the object model.
        left: (K,) indices of their blobs in the left view; `right` in the right one.
    """

    target: Indices
    left: Indices
    right: Indices
