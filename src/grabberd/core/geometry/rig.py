"""Rigs: the calibrated one, its views prepared for computing with all of them and many points at once; and
the nominal one, dimensions as built, each good to about ten per cent, with the views that follow from them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.geometry.calibration import Calibration
from grabberd.core.geometry.local_field import LocalFields
from grabberd.core.geometry.view import (
    PARAMETERS,
    View,
    polynomials,
    rotation_angles,
    rotation_derivatives,
    rotation_matrix,
)
from grabberd.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """V views; every array broadcasts against (2, V, N): coordinate, view, point.

    Attributes:
        views: The views themselves.
        rotation: (V, 3, 3), from the object's frame into the camera's, handedness included.
        rotation_rates: (3, V, 3, 3), its derivatives by ω, φ, κ.
        center_mm: (V, 3, 1), projection centres.
        f_mm: (V, 1), focal lengths.
        origin_px: (2, V, 1), x0 and y0.
        pixel_mm: (2, V, 1), mm per frame pixel; negative in y, because y of the sensor points up.
        image: (V, 8, 15), `polynomials` of the views in frame pixels, including the point itself:
            column, line = origin + own·P + other·Q, with S and T their slopes in px/mm.
        corrects: (V,) bool, True where they lead from the observed point to the ideal one.
        factor: (V, 18, K), L of the calibration's covariance C = L·Lᵀ in the parameters' order; None if C is
            zero or unknown.
        local_fields: Local field of each view; empty if no view has one. `project` and the like do not
            include it: it is subtracted from the observations.
    """

    views: tuple[View, ...]
    rotation: Array
    rotation_rates: Array
    center_mm: Array
    f_mm: Array
    origin_px: Array
    pixel_mm: Array
    image: Array
    corrects: Mask
    factor: Array | None = None
    local_fields: LocalFields | tuple[()] = ()

    @classmethod
    def of_views(cls, views: Sequence[View], factor: Array | None = None) -> "Rig":
        """Make a rig of any number of views."""
        angles = [(view.omega_rad, view.phi_rad, view.kappa_rad) for view in views]
        mirrors = np.array([np.diag([view.handedness, 1.0, 1.0]) for view in views])
        rates = np.array([rotation_derivatives(*three) for three in angles])
        return cls(
            views=tuple(views),
            rotation=mirrors @ np.array([rotation_matrix(*three) for three in angles]),
            rotation_rates=mirrors @ rates.swapaxes(0, 1),
            center_mm=np.array([view.center_mm for view in views])[:, :, np.newaxis],
            f_mm=np.array([[view.f_mm] for view in views]),
            origin_px=np.array([[[view.x0_px] for view in views], [[view.y0_px] for view in views]]),
            pixel_mm=np.array(
                [[[view.pixel_x_mm] for view in views], [[-view.pixel_y_mm] for view in views]]
            ),
            image=np.array([_image(view) for view in views]),
            corrects=np.array([view.polynomial == "correction" for view in views], np.bool_),
            factor=factor,
        )

    @classmethod
    def of(cls, calibration: Calibration) -> "Rig":
        """Make a rig of a calibration's views, left then right, with its covariance."""
        rig = cls.of_views(calibration.views, _factor(calibration.covariance))
        if not any(calibration.local_fields):
            return rig
        fields = LocalFields(*calibration.local_fields, calibration.local_correlation)
        return replace(rig, local_fields=fields)

    def local_sigma_px(self, observed_px: Array) -> Array | None:
        """(2, V, N) σ of the local fields at observed positions (2, V, N); None if no view has one."""
        if not self.local_fields:
            return None
        sigma = np.zeros(observed_px.shape)
        for index, local_field in enumerate(self.local_fields[:2]):
            if local_field is not None:
                sigma[:, index] = local_field.sigma_at(observed_px[:, index].T).T
        return sigma

    def local_errors_px(self, observed_px: Array) -> Array | None:
        """Compute what the errors of both local fields do to images (2, 2, N) of the same points.

        Returns:
            (2, 2, 4, N) shifts of the image coordinates by four independent errors of 1 σ each; None if no
            view has a local field.
        """
        sigma = self.local_sigma_px(observed_px)
        if sigma is None:
            return None
        errors = np.zeros((2, 2, 4, observed_px.shape[2]))
        for axis, (left, right) in enumerate(sigma):
            # By Cholesky: the left one's error, of which the right one has a share beside its own.
            correlation = self.local_correlation[axis]
            errors[axis, 0, 2 * axis] = left
            errors[axis, 1, 2 * axis] = correlation * right
            errors[axis, 1, 2 * axis + 1] = math.sqrt(1.0 - correlation * correlation) * right
        return errors

    @property
    def local_correlation(self) -> tuple[float, float]:
        """Correlation of the local fields' errors in x and in y, at images of one point."""
        return self.local_fields.correlation if self.local_fields else (0.0, 0.0)


def _image(view: View) -> Array:
    """(8, 15) polynomials in frame pixels, from those of the distortion or correction."""
    table = polynomials(view.b)
    table[[0, 2], :, 0] += 1.0
    table[:, 0] /= view.pixel_x_mm
    table[:, 1] /= -view.pixel_y_mm
    return table.reshape(8, -1)


def _factor(covariance: Array) -> Array | None:
    """(2, 18, K) L with L·Lᵀ = covariance, from its correlations because the units span twenty decades."""
    sigma = np.sqrt(np.diag(covariance))
    if not sigma.any():
        return None
    scale = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    # Held parameters have no variance: what the remaining directions show is rounding.
    kept = values > 1e-14 * values[-1]
    factor: Array = sigma[:, np.newaxis] * vectors[:, kept] * np.sqrt(values[kept])
    return factor.reshape(2, len(PARAMETERS), -1)


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

    @property
    def swapped(self) -> "NominalRig":
        """The same rig with its views swapped: each sees the object from the other side."""
        return replace(self, base_mm=-self.base_mm)

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


def _looking_down(turn_rad: float) -> Array:
    """(3, 3) rotation into a camera whose x is the object's Y and whose y is −X, turned about X."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    return np.array([[0.0, cosine, sine], [-1.0, 0.0, 0.0], [0.0, -sine, cosine]])
