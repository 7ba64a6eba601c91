"""Position of camera and mirrors: the reference rig from its base and distance, with misalignments.

Nominally everything lies in the plane of Y and Z: the camera on the Z axis, looking down; for each half of
the picture one or two mirrors. They are placed so that the virtual centre is at (0, ∓base/2, distance) and
the middle ray of the half passes through the object's origin. The mirrors have the local unevenness of cheap
ones: smooth displacements that no global parameter describes (paper, 4).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.optics import HALF, LINES, Array, Camera, Mirror, View
from grabberd_fake.options import CameraOptions, FakeOptions, RigOptions

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
    turned: NDArray[np.float64] = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return turned


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
