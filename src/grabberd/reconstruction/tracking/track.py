"""Track: the state of all targets of an object after a field."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.reconstruction.object_model import ObjectModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """M targets after a field; immutable, each step makes a new one.

    Attributes:
        target: (M,) int32, ids, ascending: all of the object model.
        xyz_mm: (M, 3) positions, smoothed over the object; those of unseen targets are predicted by the
            others.
        sigma_mm: (M,) standard deviation of a position in each coordinate.
        velocity_mm_s: (M, 3).
        speed_sigma_mm_s: Standard deviation of a velocity in each coordinate.
        unseen_s: (M,) time since a target was last seen; infinite if it never was.
        age_s: Time since the field of these positions and velocities; infinite if nothing has been tracked.
        found: Number of targets found in that field.
    """

    target: NDArray[np.int32]
    xyz_mm: Array
    sigma_mm: Array
    velocity_mm_s: Array
    speed_sigma_mm_s: float
    unseen_s: Array
    age_s: float
    found: int

    @classmethod
    def start(cls, model: ObjectModel) -> "Track":
        """Make the track before the first field: nominal positions, nothing seen."""
        count = len(model)
        return cls(
            target=model.target,
            xyz_mm=model.xyz_mm,
            sigma_mm=np.full(count, np.inf),
            velocity_mm_s=np.zeros((count, 3)),
            speed_sigma_mm_s=np.inf,
            unseen_s=np.full(count, np.inf),
            age_s=np.inf,
            found=0,
        )
