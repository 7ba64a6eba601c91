"""Nominal rig: dimensions as built, each good to about ten per cent, and the views that follow from them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry.view import View, rotation_angles
from grabberd.errors import InputError

_MOST_CONTRADICTION = 1.4
"""Ratio of stated to computed convergence: three numbers, each good to ten per cent, agree within it."""


@dataclass(frozen=True, slots=True)
class NominalRig:
    """Prior knowledge of a rig: one camera that sees the object's origin in the middle of either half.

    Attributes:
        columns: Picture width in pixels.
        lines: Picture height in frame lines.
        left: First frame column of the left view's half, and the one after its last.
        right: Likewise for the right view.
        distance_mm: Distance of the virtual cameras from the object's plane.
        base_mm: Distance between the virtual cameras, along the object's Y.
        convergence_deg: Angle between the middle rays of the two halves.
        focal_length_mm: Focal length of the lens.
        pixel_x_mm: Pixel pitch along a line.
        pixel_y_mm: Pitch from frame line to frame line.
        handedness: Of the left and the right view, +1 or −1 as their mirrors make it; None where not stated.
    """

    columns: int
    lines: int
    left: tuple[int, int]
    right: tuple[int, int]
    distance_mm: float
    base_mm: float
    convergence_deg: float
    focal_length_mm: float
    pixel_x_mm: float
    pixel_y_mm: float
    handedness: tuple[int | None, int | None] = (None, None)

    def views(self, handedness: tuple[int, int] = (1, 1)) -> tuple[View, View]:
        """Make the two virtual cameras, without distortion, with the principal point in the picture's centre.

        Base, distance and convergence are redundant; their contradiction is shared among the three in equal
        proportions. A view's camera is turned away from the ray to the object's origin, because the middle of
        its half is not the middle of the picture.

        Args:
            handedness: Of the left and the right view, +1 or −1.

        Raises:
            InputError: Base and distance imply a very different convergence.
        """
        share = self._contradiction() ** (1 / 3)
        aside_mm, height_mm = 0.5 * self.base_mm * share, self.distance_mm / share
        return (
            self._view("left", self.left, handedness[0], (-aside_mm, height_mm)),
            self._view("right", self.right, handedness[1], (aside_mm, height_mm)),
        )

    def _contradiction(self) -> float:
        """Ratio of the stated convergence to the one implied by base and distance."""
        made_deg = 2 * math.degrees(math.atan(0.5 * abs(self.base_mm) / self.distance_mm))
        ratio = self.convergence_deg / made_deg
        if not 1 / _MOST_CONTRADICTION < ratio < _MOST_CONTRADICTION:
            raise InputError(
                f"the rig's base {self.base_mm:g} mm at {self.distance_mm:g} mm distance implies a "
                f"convergence of {made_deg:.1f} degrees, but {self.convergence_deg:g} are stated",
                "check base_mm, distance_mm and convergence_deg on the rig: ten per cent is accurate enough",
            )
        return ratio

    def _view(self, name: str, half: tuple[int, int], handedness: int, place_mm: tuple[float, float]) -> View:
        along_mm, height_mm = place_mm
        center_px = 0.5 * (self.columns - 1)
        middle_mm = (0.5 * (half[0] + half[1] - 1) - center_px) * self.pixel_x_mm
        turn = -math.atan2(along_mm, height_mm) - handedness * math.atan(middle_mm / self.focal_length_mm)
        omega, phi, kappa = rotation_angles(_looking_down(turn))
        return View(
            name=name,
            first_column=half[0],
            end_column=half[1],
            pixel_x_mm=self.pixel_x_mm,
            pixel_y_mm=self.pixel_y_mm,
            handedness=handedness,
            f_mm=self.focal_length_mm,
            x0_px=center_px,
            y0_px=0.5 * (self.lines - 1),
            omega_rad=omega,
            phi_rad=phi,
            kappa_rad=kappa,
            X0_mm=0.0,
            Y0_mm=along_mm,
            Z0_mm=height_mm,
        )


def _looking_down(turn_rad: float) -> NDArray[np.float64]:
    """(3, 3) rotation into a camera whose x is the object's Y and whose y is −X, turned about X."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    return np.array([[0.0, cosine, sine], [-1.0, 0.0, 0.0], [0.0, -sine, cosine]])
