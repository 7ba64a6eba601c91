"""One real camera and plane mirrors: where a point of the object appears in the picture.

Nothing here knows of virtual cameras: a point is reflected in every mirror its light meets, the one nearest to the
object first, and the real camera sees the last of these images. Frame pixels are those of the whole program, see
`View.image`.
"""

from collections.abc import Callable
from dataclasses import dataclass

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
        return xyz_mm - 2 * np.multiply.outer(xyz_mm @ self.normal - self.distance_mm, self.normal)


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """The real camera: centre (3,) mm and axes (3, 3), whose rows are its x, y, z in the object's frame.

    It looks along −z; x runs along the lines to the right, y upwards across them.
    """

    options: CameraOptions
    center_mm: Array
    axes: Array

    def project(self, xyz_mm: Array) -> Array:
        """(N, 2) sensor pixels (column, sensor line) of points (N, 3); NaN for points not before the camera."""
        along = (xyz_mm - self.center_mm) @ self.axes.T
        depth = np.where(along[:, 2] < -1e-6, -along[:, 2], np.nan)
        return self._to_pixels(self._distort(self.options.f_mm * along[:, 0] / depth, self.options.f_mm * along[:, 1] / depth))

    def _distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        k3, k5, k7 = self.options.radial
        p1, p2 = self.options.decentering
        r2 = x * x + y * y
        radial = 1 + r2 * (k3 + r2 * (k5 + r2 * k7))
        cross = 2 * x * y
        return x * radial + p1 * (r2 + 2 * x * x) + p2 * cross, y * radial + p1 * cross + p2 * (r2 + 2 * y * y)

    def _to_pixels(self, xy_mm: tuple[Array, Array]) -> Array:
        x, y = xy_mm
        column = self.options.x0_px + x / self.options.pixel_x_mm
        line = self.options.y0_px - y / self.options.pixel_y_mm
        return np.stack([column, line], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One half of the picture: the camera through this half's mirrors.

    Attributes:
        name: "left" or "right"; `first_column`: of its half.
        camera: the real camera, the same for both.
        mirrors: in the order in which light from the object meets them.
        displacement: (N, 2) pixels → (N, 2) pixels that the mirrors' local errors add there.
        line_offset: what a frame line that a row stands for lies above the middle of the sensor lines it collects.
    """

    name: str
    first_column: int
    camera: Camera
    mirrors: tuple[Mirror, ...]
    displacement: Callable[[Array], Array]
    line_offset: float

    def reflected(self, xyz_mm: Array) -> Array:
        """(N, 3) where the camera sees the points (N, 3) behind the mirrors."""
        for mirror in self.mirrors:
            xyz_mm = mirror.reflect(xyz_mm)
        return xyz_mm

    def center_mm(self) -> Array:
        """(3,) where the camera is seen from the object: it, reflected in the mirrors the other way round."""
        center = self.camera.center_mm
        for mirror in reversed(self.mirrors):
            center = mirror.reflect(center)
        return center

    def axes(self) -> Array:
        """(3, 3) the camera's axes as rows, as seen from the object; determinant −1 after an odd number of mirrors."""
        axes = self.camera.axes
        for mirror in reversed(self.mirrors):
            axes = axes - 2 * np.multiply.outer(axes @ mirror.normal, mirror.normal)
        return axes

    def ideal_image(self, xyz_mm: Array) -> Array:
        """(N, 2) frame pixels of points (N, 3) through perfect mirrors.

        A perfect locator that takes row k of parity p as y = 2k + p finds a target there: with field integration a
        row collects sensor lines 2k + p and 2k + p + 1, so every y is half a line less than on the sensor.
        """
        image = self.camera.project(self.reflected(xyz_mm))
        image[:, 1] += self.line_offset
        return image

    def image(self, xyz_mm: Array) -> Array:
        """`ideal_image` with the mirrors' local errors."""
        ideal = self.ideal_image(xyz_mm)
        return ideal + self.displacement(ideal)

    def holds(self, xy_px: Array) -> NDArray[np.bool_]:
        """(N,) which of the (N, 2) frame pixels lie in this view's half; NaN does not."""
        x, y = xy_px[:, 0] - self.first_column, xy_px[:, 1]
        return (x >= -0.5) & (x < HALF - 0.5) & (y >= -0.5) & (y < LINES - 0.5)
