"""The simulated world: scenes in front of the camera, and picture and truth at any time.

The camera runs freely on the clock: field k is exposed around k periods of it, and the even ones are top
fields. So a field's picture and truth depend only on the options and its time, not on what was read or lost
before (except that with automatic gain, the picture depends on earlier fields).
"""

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.faults import Knock
from grabberd_fake.light_options import share_lit
from grabberd_fake.liner import EllipseLiner, Liner
from grabberd_fake.optics import (
    Array,
    Ellipses,
    Targets,
    View,
    build_views,
    disc_images,
    facing,
    grid_numbers,
    knocked,
    light_image,
    smeared,
)
from grabberd_fake.options import FakeOptions, PointOption
from grabberd_fake.render import ROWS, Renderer, Sensor
from grabberd_fake.stamp import Stamp, write_stamp

# Copies so close blur into one another under a spread of .8 px.
_COPY_EVERY_PX = 0.25


class Truth(NamedTuple):
    """Truth of N targets at one time.

    Attributes:
        ids: (N,) int32, ascending.
        xyz_mm: (N, 3), object's frame; `normals`: (N, 3) unit vectors, outward.
        left_px: (N, 2) frame pixels of the centre of each target's image in the left view, as found by a
            perfect locator that takes row k of parity p as y = 2k + p: with perspective eccentricity and the
            mirrors' local errors, without line jitter; hidden targets included. `right_px` likewise.
        visible_left: (N,) bool, True for targets that face the view and lie in its half of the picture;
            `visible_right` likewise.
    """

    ids: NDArray[np.int32]
    xyz_mm: Array
    normals: Array
    left_px: Array
    right_px: Array
    visible_left: NDArray[np.bool_]
    visible_right: NDArray[np.bool_]


class World:
    """Scene, optics and camera."""

    waited_ns = 0  # pictures are drawn when they are asked for
    origin = 0

    def __init__(self, options: FakeOptions) -> None:
        self._options = options
        self.views = build_views(options)
        self._knocks = [fault for fault in options.faults if isinstance(fault, Knock)]
        self._marks = own_points(options.rig.marks).nominal()
        self.scene = build_scene(options)
        self._renderer = Renderer(options.picture)
        self._sensor = Sensor(options.picture)

    def truth(self, time_ns: int) -> Truth:
        """Truth at a time."""
        targets = self.scene.targets(time_ns)
        left, right = (disc_images(view, targets, self._options.target_diameter_mm) for view in self.views)
        seen = [
            self._facing(view, targets) & view.holds(images.center)
            for view, images in zip(self.views, (left, right), strict=True)
        ]
        return Truth(
            self.scene.ids, targets.xyz_mm, targets.normal, left.center, right.center, seen[0], seen[1]
        )

    def picture(self, field: int, out: NDArray[np.uint8]) -> None:
        """Writes the luma of the camera's field number `field` into `out`, (288, 720) or (576, 720)."""
        driver, rng = self._options.driver, self.random(field)
        exposed = self._exposed(field * driver.period_ns, self._views_in(field))
        for parity in (0, 1) if driver.is_progressive else (field % 2,):
            shift_px = rng.normal(0, self._options.picture.jitter_px, ROWS)
            canvas = self._renderer.draw(exposed, parity, shift_px)
            self._sensor.expose(canvas, rng, out[parity::2] if driver.is_progressive else out)
        if self._options.picture.stamp:
            write_stamp(out, Stamp(field, 0 if driver.is_progressive else field % 2))

    def random(self, field: int) -> np.random.Generator:
        """The random numbers of a field."""
        return random_of(self._options.seed, field)

    def _views_in(self, field: int) -> tuple[View, View]:
        """The views as the knocks up to a field have left them."""
        views = self.views
        for knock in self._knocks:
            if knock.paced(self._options.driver.rate_hz).first <= field - self.origin:
                views = knocked(views, knock.what, (knock.x_mrad, knock.y_mrad, knock.z_mrad))
        return views

    def _exposed(self, time_ns: int, views: tuple[View, View]) -> tuple[Ellipses, Ellipses]:
        targets = self.scene.targets(time_ns)
        half_ns = round(self._options.picture.exposure_ms * 0.5e6)
        ends = None
        if self.scene.moves and half_ns > 0:
            ends = self.scene.targets(time_ns - half_ns), self.scene.targets(time_ns + half_ns)
        left, right = (self._seen(view, targets, ends) for view in views)
        if self._options.rig.marks:
            marks = (self._seen(view, self._marks, None) for view in views)
            left, right = (Ellipses.joined(both) for both in zip((left, right), marks, strict=True))
        if self._options.light.diameter_px > 0:
            share = share_lit(self._options.light, time_ns, 2 * half_ns)
            lamp = light_image(self._options.light, share)
            left, right = (Ellipses.joined(both) for both in zip((left, right), lamp, strict=True))
        return left, right

    def _seen(self, view: View, targets: Targets, ends: tuple[Targets, Targets] | None) -> Ellipses:
        seen = self._facing(view, targets)
        targets = Targets(targets.xyz_mm[seen], targets.normal[seen])
        images = disc_images(view, targets, self._options.target_diameter_mm)
        if ends is None or not len(images):
            return images
        way_mm = [targets.xyz_mm, *(moved.xyz_mm[seen] for moved in ends)]
        middle, start, end = view.ideal_image(np.concatenate(way_mm)).reshape(3, -1, 2)
        return smeared(images, start - middle, end - middle, _COPY_EVERY_PX)

    def _facing(self, view: View, targets: Targets) -> NDArray[np.bool_]:
        return facing(view, targets, self._options.grazing_limit_deg)


def random_of(seed: int, field: int) -> np.random.Generator:
    """The random numbers of a field: no other field's depend on how many of them are drawn."""
    return np.random.Generator(np.random.SFC64([seed, field]))


class Scene(Protocol):
    """N targets in time.

    Attributes:
        ids: (N,) int32, ascending; `row`, `column`: (N,) int32, positions in the target grid.
        moves: True if `targets` depends on the time.
    """

    ids: NDArray[np.int32]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    moves: bool

    def targets(self, time_ns: int) -> Targets:
        """Positions of the targets; they depend on the time alone."""
        ...

    def nominal(self) -> Targets:
        """Positions of the targets in the object model."""
        ...


class Still:
    """A scene that stands still."""

    moves = False

    def __init__(
        self, targets: Targets, row: NDArray[np.int32], column: NDArray[np.int32], ids: NDArray[np.int32]
    ) -> None:
        self.ids, self.row, self.column = ids, row, column
        self._targets = targets

    @classmethod
    def grid(cls, targets: Targets, rows: int, columns: int) -> "Still":
        """Targets row by row, numbered from 1."""
        return cls(targets, *grid_numbers(rows, columns), np.arange(1, rows * columns + 1, dtype=np.int32))

    def targets(self, time_ns: int) -> Targets:
        """Targets at any time."""
        return self._targets

    def nominal(self) -> Targets:
        """Targets of the object model."""
        return self._targets


def build_scene(options: FakeOptions) -> Scene:
    """The scene that the options name."""
    match options.scene:
        case "liner":
            return Liner(options.liner)
        case "ellipse":
            return EllipseLiner(options.ellipse)
        case "calibration_frame":
            return calibration_frame()
        case "accuracy_object":
            return accuracy_object()
        case "points":
            return own_points(options.points)
    return own_points(())


# Steps without self-similarity, see `calibration_frame`.
_FRAME_ROW_MM = (-3.0, 2.0, 4.0, -4.0, 1.0, -2.0, 3.5, -3.5, 0.0, 4.0, -1.0, -4.0)
_FRAME_COLUMN_MM = (-4.0, 2.5, -1.0, 4.0, -2.5, 3.5, -4.0, 1.0, 4.0)


def calibration_frame() -> Still:
    """The paper's 108 targets: 12 rows 9.75 mm apart along X, 9 columns 6.5 mm along Y, steps of ±8 mm.

    It reaches over the whole liner. The height is a row's step plus a column's; neither series resembles
    itself one place on, so a wrong identity by one pitch does not fit.
    """
    row, column = grid_numbers(12, 9)
    height_mm = np.array(_FRAME_ROW_MM)[row] + np.array(_FRAME_COLUMN_MM)[column]
    places = np.column_stack([(row - 5.5) * 9.75, (column - 4.0) * 6.5, height_mm])
    return Still.grid(Targets(places, np.tile([0.0, 0.0, 1.0], (len(places), 1))), 12, 9)


def accuracy_object() -> Still:
    """60 targets on a body unlike the calibration frame: a saddle with a step, 10 irregular rows of 6."""
    row, column = grid_numbers(10, 6)
    irregular_mm = np.random.default_rng(60).uniform(-1.2, 1.2, (60, 2))
    x, y = np.column_stack([(row - 4.5) * 9.5, (column - 2.5) * 7.0]).T + irregular_mm.T
    step_mm = np.where(row >= 5, 2.5, -2.5)
    z = step_mm + y * y / 60 - x * x / 400
    slope = np.column_stack([x / 200, -y / 30, np.ones(60)])
    places = np.column_stack([x, y, z]).round(4)
    return Still.grid(Targets(places, slope / np.linalg.norm(slope, axis=1, keepdims=True)), 10, 6)


def own_points(points: tuple[PointOption, ...]) -> Still:
    """The targets that the options list, sorted by id; each is a row of its own in the target grid."""
    ordered = sorted(points, key=lambda point: point.id)
    places = np.array([[p.x_mm, p.y_mm, p.z_mm] for p in ordered]).reshape(-1, 3)
    normals = np.array([_unit(p.nx, p.ny, p.nz) for p in ordered]).reshape(-1, 3)
    row, column = grid_numbers(len(ordered), 1)
    return Still(Targets(places, normals), row, column, np.array([p.id for p in ordered], np.int32))


def _unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
