"""One real camera behind plane mirrors: where they stand, and where a point of the object appears.

Nothing here knows of virtual cameras: a point is reflected in every mirror that its light meets, the one
nearest to the object first, and the real camera sees the last of these images. Nominally all lies in the
plane of Y and Z, so that the virtual centres are at (0, ∓base/2, distance) and the middle ray of each half
passes through the object's origin. Mirrors have the local unevenness of cheap ones: smooth displacements that
no global parameter describes (paper, 4). Frame pixels are those of the whole program, see `View.image`.

Targets, which are discs in space, and their images as ellipses in the picture; the image of the light.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.light_options import LightOptions
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


def knocked(views: tuple[View, View], what: str, turn_mrad: Sequence[float]) -> tuple[View, View]:
    """The views after the camera, or the mirror of one view nearest to the object, has been turned.

    Args:
        views: left and right view before.
        what: "camera", "left" or "right".
        turn_mrad: (3,) turn about the camera's axes; a mirror turns where the middle ray meets it.
    """
    turn = np.asarray(turn_mrad) / 1000.0
    camera = views[0].camera
    if what == "camera":
        moved = replace(camera, axes=_small_rotation(turn).T @ camera.axes)
        left, right = (replace(view, camera=moved) for view in views)
        return left, right
    left, right = (_with_turned_mirror(view, turn) if view.name == what else view for view in views)
    return left, right


def _with_turned_mirror(view: View, turn_rad: Array) -> View:
    first, *others = view.mirrors
    center = view.center_mm()
    along = (first.distance_mm - first.normal @ center) / (first.normal @ -center)
    place = center - along * center
    axes = view.camera.axes
    turned = Mirror.through(place, axes.T @ _small_rotation(turn_rad) @ axes @ first.normal)
    return replace(view, mirrors=(turned, *others))


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


class Targets(NamedTuple):
    """N discs.

    Attributes:
        xyz_mm: (N, 3) their centres in the object's frame; `normal`: (N, 3) unit vectors, outward.
    """

    xyz_mm: Array
    normal: Array


def grid_numbers(rows: int, columns: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Row and column of every place of a grid, row by row; (rows · columns,) each."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int32), np.int32(columns))
    return row, column


# The first harmonics of the boundary make the ellipse; eight points keep higher ones from aliasing into it.
_BOUNDARY = 8
_ANGLES = np.arange(_BOUNDARY) * (2 * np.pi / _BOUNDARY)
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)


@dataclass(frozen=True, slots=True, eq=False)
class Ellipses:
    """N ellipses in frame pixels: center + a cos t + b sin t, each with its own weight.

    Attributes:
        center: (N, 2); `a`, `b`: (N, 2) conjugate half axes.
        weight: (N,) share of the exposure for which the target stood there.
    """

    center: Array
    a: Array
    b: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.center)

    def select(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> "Ellipses":
        """The ellipses chosen by a mask or index array."""
        return Ellipses(self.center[which], self.a[which], self.b[which], self.weight[which])

    @classmethod
    def joined(cls, parts: "Sequence[Ellipses]") -> "Ellipses":
        """All of them, in order."""
        return cls(
            np.concatenate([part.center for part in parts]),
            np.concatenate([part.a for part in parts]),
            np.concatenate([part.b for part in parts]),
            np.concatenate([part.weight for part in parts]),
        )


def disc_images(view: View, targets: Targets, diameter_mm: float) -> Ellipses:
    """Images of the discs with their perspective eccentricity, to second order of their size.

    The mean of a disc's boundary lies half as far from the image of its centre as the ellipse's centre does.
    """
    around = _rim(targets, diameter_mm / 2)
    count = len(targets.xyz_mm)
    points = view.ideal_image(around.reshape(-1, 3)).reshape(count, _BOUNDARY + 1, 2)
    rim, middle = points[:, 1:], points[:, 0]
    # The same displacement for the whole disc: mirror errors vary over 60 px and more, a disc covers a few.
    center = 2 * rim.mean(axis=1) - middle
    a = np.einsum("nkx,k->nx", rim, _COSINES * (2 / _BOUNDARY))
    b = np.einsum("nkx,k->nx", rim, _SINES * (2 / _BOUNDARY))
    return Ellipses(center + view.displacement(center), a, b, np.ones(count))


def _rim(targets: Targets, radius_mm: float) -> Array:
    """(N, 1 + _BOUNDARY, 3): the centre, then points of the boundary."""
    u, v = _in_plane(targets.normal)
    spokes = np.concatenate([[[0.0, 0.0]], np.column_stack([_COSINES, _SINES])]) * radius_mm
    basis = np.stack([u, v], axis=1)
    return targets.xyz_mm[:, np.newaxis] + spokes @ basis


def _in_plane(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (N, 3) that span the plane of each unit normal (N, 3)."""
    x, y, z = normal.T
    # Without branches or a singular direction (Duff et al., Building an orthonormal basis, revisited, 2017).
    sign = np.copysign(1.0, z)
    scale = -1.0 / (sign + z)
    cross = x * y * scale
    first = np.stack([1 + sign * x * x * scale, sign * cross, -sign * x], axis=1)
    return first, np.stack([cross, sign + y * y * scale, -y], axis=1)


def facing(view: View, targets: Targets, grazing_limit_deg: float) -> NDArray[np.bool_]:
    """(N,) True for discs whose front a view sees less obliquely than the limit."""
    sight = view.center_mm() - targets.xyz_mm
    along = np.einsum("nx,nx->n", sight, targets.normal)
    limit = math.cos(math.radians(grazing_limit_deg))
    return along > limit * np.sqrt(np.einsum("nx,nx->n", sight, sight))


def smeared(ellipses: Ellipses, start: Array, end: Array, step_px: float) -> Ellipses:
    """The ellipses over an exposure, as copies along the path of each.

    Args:
        ellipses: ellipses in the middle of the exposure.
        start: (N, 2) positions of the centres at its beginning, relative to the middle.
        end: (N, 2) positions at its end, likewise.
        step_px: greatest distance between copies. The path is a parabola through start, middle and end.
    """
    way = np.hypot(*start.T) + np.hypot(*end.T)
    copies = np.maximum(np.ceil(way / step_px), 1).astype(np.intp)
    if copies.max(initial=1) == 1:
        return ellipses
    which = np.repeat(np.arange(len(ellipses)), copies)
    number = np.arange(len(which)) - np.repeat(np.cumsum(copies) - copies, copies)
    time = ((2 * number + 1) / copies[which] - 1)[:, np.newaxis]
    moved = (end - start)[which] * (time / 2) + (end + start)[which] * (time * time / 2)
    copied = ellipses.select(which)
    return Ellipses(copied.center + moved, copied.a, copied.b, (1.0 / copies)[which])


def light_image(options: LightOptions, share: float) -> tuple[Ellipses, Ellipses]:
    """Its images in the left and the right half, each in frame pixels: it lies in one of them."""
    left = options.x_px < HALF
    return _disc(options, share, left), _disc(options, share, not left)


def _disc(options: LightOptions, share: float, drawn: bool) -> Ellipses:
    radius, count = options.diameter_px / 2, int(drawn)

    def rows(x: float, y: float) -> Array:
        return np.full((count, 2), (x, y))

    weight = np.full(count, share * options.brightness)
    return Ellipses(rows(options.x_px, options.y_px), rows(radius, 0.0), rows(0.0, radius), weight)
