"""Plane-parallel glass plate between cameras and object: its effect on rays and pictures.

A plate keeps the direction of every ray and shifts it sideways, so that it seems to come from a place nearer
to the camera by t·(1 − cos θ/√(n² − sin² θ)) along the plate's normal, θ being the angle to the normal; near
the normal that is t·(1 − 1/n). The position of the plate does not matter, only that it lies in between.

A calibration made through the plate needs none of this: of the 1.2 px (RMS) by which 3 mm of glass change the
reference rig's pictures, equations (4)–(7) absorb all but .0003 px, and for a plate of 5 mm tilted by 20° all
but .002 px; without any of b1…b9, .010 and .05 px remain. The model is meant for planning, and for a plate
inserted where calibrating again is impossible.
"""

from dataclasses import dataclass

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.geometry.functional_model import project
from grabberd.core.geometry.view import View
from grabberd.errors import InputError

_SETTLED_MM = 1e-10
_MOST_STEPS = 60


@dataclass(frozen=True, slots=True)
class Plate:
    """A plane-parallel plate with the same medium on both sides.

    Attributes:
        thickness_mm: Thickness of the plate, above 0.
        refractive_index: Index relative to the medium, at least 1.
        normal: Direction across the plate in the object's frame, of either sign and any length.

    Raises:
        InputError: A thickness, index or normal is out of range.
    """

    thickness_mm: float
    refractive_index: float
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not (self.thickness_mm > 0 and self.refractive_index >= 1 and any(self.normal)):
            raise InputError(
                f"invalid plate: thickness {self.thickness_mm} mm, index {self.refractive_index}, normal "
                f"{self.normal}",
                "give a thickness above 0, an index of at least 1 (glass: 1.52) and a normal that is not 0",
            )

    @property
    def unit(self) -> Array:
        """(3,) unit normal."""
        normal = np.array(self.normal, np.float64)
        return normal / np.linalg.norm(normal)

    def shift_mm(self, directions: Array) -> Array:
        """(N,) apparent shift along the normal toward the camera, for rays with unit directions (N, 3)."""
        cosine = np.abs(directions @ self.unit)
        inside = np.sqrt(self.refractive_index**2 - 1.0 + cosine**2)
        return self.thickness_mm * (1.0 - cosine / inside)


def seen_through(plate: Plate, center_mm: Array, xyz_mm: Array) -> Array:
    """Compute where points appear to be for a camera that sees them through a plate.

    Args:
        plate: Plate between camera and points.
        center_mm: (3,) projection centre.
        xyz_mm: (N, 3) points in the object's frame.

    Returns:
        (N, 3) points on the rays that reach the camera: projecting them without a plate gives the picture
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
    """Project points (N, 3) through a plate into a view calibrated without it, giving (N, 2) frame pixels."""
    return project(view, seen_through(plate, view.center_mm, xyz_mm))


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
