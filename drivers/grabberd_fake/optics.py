"""One real camera behind plane mirrors: where they stand, and where a point of the object appears.

Nothing here knows of virtual cameras: a point is reflected in every mirror that its light meets, the one
nearest to the object first, and the real camera sees the last of these images. Nominally all lies in the
plane of Y and Z, so that the virtual centres are at (0, ∓base/2, distance) and the middle ray of each half
passes through the object's origin. Mirrors have the local unevenness of cheap ones: smooth displacements that
no global parameter describes (paper, 4). Frame pixels are those of the whole program, see `View.image`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.options import CameraOptions, FakeOptions, RigOptions

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


_SIDES = {"left": -1.0, "right": 1.0}
_LOOKING_DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


class Placed(NamedTuple):
    """A mirror by its normal and the point where the middle ray meets it."""

    point_mm: Array
    normal: Array


def build_views(options: FakeOptions) -> tuple[View, View]:
    """Left and right view of the rig, with its misalignments."""
    rig = options.rig
    # Misalignments and local errors draw from streams of their own: changing one leaves the other as it was.
    rng = np.random.default_rng([rig.seed, 1])
    height_mm, mirrors = _nominal(rig, options.camera)
    camera = _mounted(options, height_mm, rng)
    left, right = (
        View(
            name,
            HALF * half,
            camera,
            tuple(_misaligned(mirror, rig, rng) for mirror in mirrors[name]),
            LocalError.draw(rig.mirror_error_px, HALF * half, [rig.seed, 2, half]),
            -0.5 if options.picture.field_integration else 0.0,
        )
        for half, name in enumerate(_SIDES)
    )
    return left, right


def _nominal(rig: RigOptions, camera: CameraOptions) -> tuple[float, dict[str, list[Placed]]]:
    """Height of the camera, and each view's mirrors in the order of the light."""
    half_angle = math.atan(HALF / 2 * camera.pixel_x_mm / camera.f_mm)
    placed = {name: _mirrors_of(rig, side, half_angle) for name, side in _SIDES.items()}
    return placed["left"][0], {name: mirrors for name, (_, mirrors) in placed.items()}


def _mirrors_of(rig: RigOptions, side: float, half_angle: float) -> tuple[float, list[Placed]]:
    ray = np.array([0.0, side * math.sin(half_angle), -math.cos(half_angle)])
    center = np.array([0.0, side * rig.base_mm / 2, rig.distance_mm])
    into_object = -center / np.linalg.norm(center)
    inner = _wedge(ray, side, rig.fold_mm) if rig.reflections == 2 else None
    image, folded = (_reflected_origin(inner), np.array([0.0, side, 0.0])) if inner else (np.zeros(3), ray)
    # The outer mirror turns the folded ray into the one to the object and carries the camera's image to the
    # centre: centre − (camera + image) is parallel to its normal, which is linear in the camera's height.
    normal = into_object - folded
    height = center[2] - image[2] - (center[1] - image[1]) * normal[2] / normal[1]
    camera = np.array([0.0, 0.0, height])
    outer = Mirror.through((center + camera + image) / 2, normal)
    along = (outer.distance_mm - outer.normal @ center) / (outer.normal @ into_object)
    mirrors = [Placed(center + along * into_object, normal)]
    return float(height), mirrors + ([Placed(camera + inner.point_mm, inner.normal)] if inner else [])


def _wedge(ray: Array, side: float, fold_mm: float) -> Placed:
    """The inner mirror, relative to the camera: it sends the middle ray straight out along Y."""
    return Placed(ray * fold_mm / -ray[2], np.array([0.0, side, 0.0]) - ray)


def _reflected_origin(mirror: Placed) -> Array:
    return Mirror.through(mirror.point_mm, mirror.normal).reflect(np.zeros(3))


def _mounted(options: FakeOptions, height_mm: float, rng: np.random.Generator) -> Camera:
    tilt = _small_rotation(rng.normal(0, options.rig.camera_tilt_mrad / 1000, 3))
    shift = rng.normal(0, options.rig.camera_shift_mm, 3)
    return Camera(options.camera, np.array([0.0, 0.0, height_mm]) + shift, _LOOKING_DOWN @ tilt.T)


def _misaligned(mirror: Placed, rig: RigOptions, rng: np.random.Generator) -> Mirror:
    tilt = _small_rotation(rng.normal(0, rig.mirror_tilt_mrad / 1000, 3))
    unit = mirror.normal / np.linalg.norm(mirror.normal)
    return Mirror.through(mirror.point_mm + unit * rng.normal(0, rig.mirror_shift_mm), tilt @ unit)


def _small_rotation(turn_rad: Array) -> NDArray[np.float64]:
    """The rotation by a rotation vector (3,) (Rodrigues' formula)."""
    angle = float(np.linalg.norm(turn_rad))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = turn_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


_WAVES = 12
_SHORTEST_PX, _LONGEST_PX = 60.0, 180.0


@dataclass(frozen=True, slots=True, eq=False)
class LocalError:
    """A sum of plane waves; each coordinate has mean zero and the given rms over a half picture.

    Attributes:
        wave: (2, W) rad per pixel; `phase`: (W,) rad; `amplitude`: (W, 2) px; `mean`: (2,) px, taken off.
    """

    wave: Array
    phase: Array
    amplitude: Array
    mean: Array

    @classmethod
    def draw(cls, rms_px: float, first_column: int, seed: Sequence[int]) -> "LocalError":
        """Random error of the half that begins at `first_column`."""
        rng = np.random.default_rng(seed)
        number = 2 * np.pi / rng.uniform(_SHORTEST_PX, _LONGEST_PX, _WAVES)
        heading = rng.uniform(0, 2 * np.pi, _WAVES)
        wave = number * np.stack([np.cos(heading), np.sin(heading)])
        raw = cls(wave, rng.uniform(0, 2 * np.pi, _WAVES), rng.normal(0, 1, (_WAVES, 2)), np.zeros(2))
        sample = raw(_half_picture(first_column))
        scale = rms_px / sample.std(axis=0)
        return cls(raw.wave, raw.phase, raw.amplitude * scale, sample.mean(axis=0) * scale)

    def __call__(self, xy_px: Array) -> Array:
        """(N, 2) displacements at the frame pixels (N, 2)."""
        return np.cos(xy_px @ self.wave + self.phase) @ self.amplitude - self.mean


def _half_picture(first_column: int) -> Array:
    columns, lines = np.meshgrid(
        np.arange(first_column, first_column + HALF, 6.0), np.arange(0.0, LINES, 6.0)
    )
    return np.column_stack([columns.ravel(), lines.ravel()])
