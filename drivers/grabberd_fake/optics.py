"""One real camera and plane mirrors: where a point of the object appears in the picture.

Nothing here knows of virtual cameras: a point is reflected in every mirror that its light meets, the one
nearest to the object first, and the real camera sees the last of these images. Frame pixels are those of the
whole program, see `View.image`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.options import CameraOptions

Array = NDArray[np.float64]

COLUMNS, LINES, HALF = 720, 576, 360


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """The plane normal · X = distance_mm; normal (3,) of unit length, object's frame."""

    normal: Array
    distance_mm: float

    @classmethod
    def through(cls, point_mm: Array, normal: Array) -> "Mirror":
        """The plane through a point; the normal (3,) may have any length but zero."""
        unit = normal / np.linalg.norm(normal)
        return cls(unit, float(unit @ point_mm))

    def reflect(self, xyz_mm: Array) -> Array:
        """(N, 3) or (3,): X' = X − 2 n (n·X − d)."""
        reflected: Array = xyz_mm - 2 * np.multiply.outer(
            xyz_mm @ self.normal - self.distance_mm, self.normal
        )
        return reflected


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """The real camera: centre (3,) mm and axes (3, 3), whose rows are its x, y, z in the object's frame.

    It looks along −z; x runs along the lines to the right, y upwards across them.
    """

    options: CameraOptions
    center_mm: Array
    axes: Array

    def to_pixels(self, along_mm: Array) -> Array:
        """(N, 2) sensor pixels (column, sensor line) of points along its axes, (3, N); NaN behind it."""
        options = self.options
        scale = options.f_mm / np.where(along_mm[2] < -1e-6, -along_mm[2], np.nan)
        x, y = self._distort(along_mm[0] * scale, along_mm[1] * scale)
        pixels = np.empty((len(x), 2))
        pixels[:, 0] = options.x0_px + x / options.pixel_x_mm
        pixels[:, 1] = options.y0_px - y / options.pixel_y_mm
        return pixels

    def _distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        k3, k5, k7 = self.options.radial
        p1, p2 = self.options.decentering
        x2, y2, cross = x * x, y * y, 2 * x * y
        r2 = x2 + y2
        radial = 1 + r2 * (k3 + r2 * (k5 + r2 * k7))
        return x * radial + p1 * (r2 + 2 * x2) + p2 * cross, y * radial + p1 * cross + p2 * (r2 + 2 * y2)


@dataclass(frozen=True, eq=False)
class View:
    """One half of the picture: the camera through this half's mirrors.

    Attributes:
        name: "left" or "right"; `first_column`: first column of its half.
        camera: the real camera, the same for both.
        mirrors: mirrors in the order in which light from the object meets them.
        displacement: (N, 2) pixels → (N, 2) displacements there by the mirrors' local errors.
        line_offset: offset in lines of a row's nominal frame line from the middle of the lines it collects.
    """

    name: str
    first_column: int
    camera: Camera
    mirrors: tuple[Mirror, ...]
    displacement: Callable[[Array], Array]
    line_offset: float

    def reflected(self, xyz_mm: Array) -> Array:
        """(N, 3) mirror images of the points (N, 3), as the camera sees them."""
        for mirror in self.mirrors:
            xyz_mm = mirror.reflect(xyz_mm)
        return xyz_mm

    def center_mm(self) -> Array:
        """(3,) virtual camera centre: the real one reflected in the mirrors in reverse order."""
        center = self.camera.center_mm
        for mirror in reversed(self.mirrors):
            center = mirror.reflect(center)
        return center

    def axes(self) -> Array:
        """(3, 3) the camera's axes as rows, as seen from the object; determinant (−1)^mirrors."""
        axes = self.camera.axes
        for mirror in reversed(self.mirrors):
            axes = axes - 2 * np.multiply.outer(axes @ mirror.normal, mirror.normal)
        return axes

    def ideal_image(self, xyz_mm: Array) -> Array:
        """(N, 2) frame pixels of points (N, 3) through perfect mirrors.

        A perfect locator that takes row k of parity p as y = 2k + p finds a target there: with field
        integration a row collects sensor lines 2k + p and 2k + p + 1, so every y is half a line less than on
        the sensor.
        """
        turn, shift = self._into_camera
        image = self.camera.to_pixels(turn @ xyz_mm.T + shift)
        image[:, 1] += self.line_offset
        return image

    @cached_property
    def _into_camera(self) -> tuple[Array, Array]:
        """(3, 3) and (3, 1): reflections and camera axes as one affine map, determined by four points."""
        corners = np.vstack([np.zeros(3), np.eye(3)])
        origin, *units = (self.reflected(corners) - self.camera.center_mm) @ self.camera.axes.T
        return np.stack([unit - origin for unit in units], axis=1), origin[:, np.newaxis]

    def image(self, xyz_mm: Array) -> Array:
        """`ideal_image` with the mirrors' local errors."""
        ideal = self.ideal_image(xyz_mm)
        return ideal + self.displacement(ideal)

    def holds(self, xy_px: Array) -> NDArray[np.bool_]:
        """(N,) True for frame pixels (N, 2) in this view's half; False for NaN."""
        x, y = xy_px[:, 0] - self.first_column, xy_px[:, 1]
        return (x >= -0.5) & (x < HALF - 0.5) & (y >= -0.5) & (y < LINES - 0.5)
