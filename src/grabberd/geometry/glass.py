"""A plane-parallel plate between the cameras and the object: what it does to rays, and to pictures.

A plate keeps the direction of every ray and shifts it sideways, so that it seems to come from a place nearer
to the camera by t·(1 − cos θ/√(n² − sin² θ)) along the plate's normal, θ being the angle to the normal; near
the normal that is t·(1 − 1/n). Where the plate stands does not matter, only that it is between.

A calibration made through the plate needs nothing of this: of the 1.2 px (RMS) by which 3 mm of glass change
the reference rig's pictures equations (4)–(7) take all but .0003 px, of a plate of 5 mm tilted by 20° all but
.002 px; without any of b1…b9 .010 and .05 px stay. This is for planning, and for a plate that was put in
where calibrating again is not possible.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError
from grabberd.geometry.functional_model import project
from grabberd.geometry.view import View

Array = NDArray[np.float64]

_SETTLED_MM = 1e-10
_MOST_STEPS = 60


@dataclass(frozen=True, slots=True)
class Plate:
    """A plane-parallel plate with the same medium on both sides.

    Attributes:
        thickness_mm: of the plate, above 0.
        refractive_index: relative to the medium, at least 1.
        normal: direction across the plate in the object's frame, of either sign and any length.

    Raises:
        InputError: a number that no plate has.
    """

    thickness_mm: float
    refractive_index: float
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not (self.thickness_mm > 0 and self.refractive_index >= 1 and any(self.normal)):
            raise InputError(
                f"no plate is {self.thickness_mm} mm thick with index {self.refractive_index} and normal "
                f"{self.normal}",
                "give a thickness above 0, an index of at least 1 (glass: 1.52) and a normal that is not 0",
            )

    @property
    def unit(self) -> Array:
        """(3,) unit normal."""
        normal = np.array(self.normal, np.float64)
        unit: Array = normal / np.linalg.norm(normal)
        return unit

    def shift_mm(self, directions: Array) -> Array:
        """(N,) by how much places seem nearer along the normal, for rays with unit directions (N, 3)."""
        cosine = np.abs(directions @ self.unit)
        inside = np.sqrt(self.refractive_index**2 - 1.0 + cosine**2)
        shift: Array = self.thickness_mm * (1.0 - cosine / inside)
        return shift


def seen_through(plate: Plate, center_mm: Array, xyz_mm: Array) -> Array:
    """Where places seem to be for a camera that looks at them through a plate.

    Args:
        plate: somewhere between.
        center_mm: (3,) projection centre.
        xyz_mm: (N, 3) places, in the object's frame.

    Returns:
        (N, 3) places on the rays that reach the camera: projecting them without a plate gives the picture
        with it.
    """
    toward = plate.unit * np.sign((center_mm - xyz_mm) @ plate.unit)[:, np.newaxis]
    seeming = np.array(xyz_mm, np.float64)
    for _ in range(_MOST_STEPS):
        directions = _unit(seeming - center_mm)
        moved = xyz_mm + plate.shift_mm(directions)[:, np.newaxis] * toward
        step = np.abs(moved - seeming).max(initial=0.0)
        seeming = moved
        if step < _SETTLED_MM:
            break
    return seeming


def project_through(plate: Plate, view: View, xyz_mm: Array) -> Array:
    """(N, 2) frame pixels of places (N, 3) seen through a plate by a view that was calibrated without it."""
    return project(view, seen_through(plate, view.center_mm, xyz_mm))


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
