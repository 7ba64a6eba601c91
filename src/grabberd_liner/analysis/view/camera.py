"""A view together with its local field, the displacements beyond the functional model."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Calibration, LocalField, View, project, rays, rotation_angles

Array = NDArray[np.float64]

_STEPS = 4
"""A local field changes by far less than a tenth of a pixel per pixel: each step gains at least one digit."""
_FILLED = 0.9


class Camera(NamedTuple):
    """Projection into the actual picture, and the rays of its pixels.

    Attributes:
        view: the virtual camera.
        local_field: displacements in its picture beyond the functional model, or None.
    """

    view: View
    local_field: LocalField | None = None

    @classmethod
    def both(cls, calibration: Calibration) -> tuple["Camera", "Camera"]:
        """The left and the right camera of a calibration."""
        left, right = zip(calibration.views, calibration.local_fields, strict=True)
        return cls(*left), cls(*right)

    @property
    def columns(self) -> range:
        """The columns of its half of the picture."""
        return range(self.view.first_column, self.view.end_column)

    def pixels(self, xyz_mm: Array) -> Array:
        """(N, 2) frame pixels of points (N, 3); NaN behind the camera."""
        model_px = project(self.view, xyz_mm)
        if self.local_field is None:
            return model_px
        observed = model_px
        for _ in range(_STEPS):
            observed = model_px + self.local_field.at(np.nan_to_num(observed))
        return observed

    def directions(self, xy_px: Array) -> Array:
        """(N, 3) unit vectors from the projection centre through frame pixels (N, 2)."""
        if self.local_field is not None:
            xy_px = xy_px - self.local_field.at(xy_px)
        return rays(self.view, xy_px)[1]

    @classmethod
    def looking_at(
        cls, like: View, middle_mm: Array, azimuth_deg: float, elevation_deg: float, columns: int, lines: int
    ) -> "Camera":
        """A free camera round a point, without distortion, with the focal length and distance of a view.

        Args:
            like: view that gives focal length, pixel pitch and distance from the point.
            middle_mm: (3,) the point, shown in the middle of the picture.
            azimuth_deg: azimuth of the camera in the xy plane, from x towards y.
            elevation_deg: elevation of the camera above that plane.
            columns: width of the picture.
            lines: height of the picture.
        """
        right, up, toward = viewing_axes(azimuth_deg, elevation_deg)
        away_mm = float(np.linalg.norm(like.center_mm - middle_mm))
        center = middle_mm + away_mm * toward
        omega, phi, kappa = rotation_angles(np.stack([right, up, toward]))
        return cls(
            replace(
                like,
                name="free",
                first_column=0,
                end_column=columns,
                handedness=1,
                pixel_y_mm=like.pixel_x_mm,
                x0_px=(columns - 1) / 2,
                y0_px=(lines - 1) / 2,
                omega_rad=omega,
                phi_rad=phi,
                kappa_rad=kappa,
                X0_mm=float(center[0]),
                Y0_mm=float(center[1]),
                Z0_mm=float(center[2]),
                b=(0.0,) * 9,
            )
        )

    def filling(self, xyz_mm: Array, columns: int, lines: int) -> "Camera":
        """The camera with its pixel pitch and principal point changed so that points fill its picture.

        Args:
            xyz_mm: (N, 3) points to show, all before the camera.
            columns: width of the picture.
            lines: height of the picture.
        """
        pixels = self.pixels(xyz_mm)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        size = np.array([columns, lines])
        larger = float((_FILLED * size / np.maximum(high - low, 1e-6)).min())
        origin = (size - 1) / 2 - larger * ((low + high) / 2 - [self.view.x0_px, self.view.y0_px])
        return Camera(
            replace(
                self.view,
                pixel_x_mm=self.view.pixel_x_mm / larger,
                pixel_y_mm=self.view.pixel_y_mm / larger,
                x0_px=float(origin[0]),
                y0_px=float(origin[1]),
            )
        )


def viewing_axes(azimuth_deg: float, elevation_deg: float) -> tuple[Array, Array, Array]:
    """Unit vectors to the right and up in a picture, and from the object toward the viewer.

    Azimuth is counted in the object's xy plane from x towards y, elevation from that plane towards z, so
    (−90, 90) looks from above with x to the right, (−90, 0) from the side, (0, 0) along x.
    """
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    level = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    toward = math.cos(elevation) * level + math.sin(elevation) * np.array([0.0, 0.0, 1.0])
    return right, np.cross(toward, right), toward
