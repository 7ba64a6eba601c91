"""The simulated world: picture and truth at any time.

The camera runs freely on the clock: field k is exposed around k periods of it, and the even ones are top
fields. So a field's picture and truth depend only on the options and its time, not on what was read or lost
before (except that with automatic gain, the picture depends on earlier fields).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.discs import Ellipses, disc_images, facing, smeared
from grabberd_fake.light import light_image
from grabberd_fake.light_options import share_lit
from grabberd_fake.optics import Array, View
from grabberd_fake.options import FakeOptions
from grabberd_fake.render import ROWS, Renderer
from grabberd_fake.rig import build_views
from grabberd_fake.scenes import build_scene
from grabberd_fake.sensor import Sensor
from grabberd_fake.stamp import Stamp, write_stamp
from grabberd_fake.targets import Targets

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

    def __init__(self, options: FakeOptions) -> None:
        self._options = options
        self.views = build_views(options)
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
        exposed = self._exposed(field * driver.period_ns)
        for parity in (0, 1) if driver.is_progressive else (field % 2,):
            shift_px = rng.normal(0, self._options.picture.jitter_px, ROWS)
            canvas = self._renderer.draw(exposed, parity, shift_px)
            self._sensor.expose(canvas, rng, out[parity::2] if driver.is_progressive else out)
        if self._options.picture.stamp:
            write_stamp(out, Stamp(field, 0 if driver.is_progressive else field % 2))

    def random(self, field: int) -> np.random.Generator:
        """The random numbers of a field."""
        return random_of(self._options.seed, field)

    def _exposed(self, time_ns: int) -> tuple[Ellipses, Ellipses]:
        targets = self.scene.targets(time_ns)
        half_ns = round(self._options.picture.exposure_ms * 0.5e6)
        ends = None
        if self.scene.moves and half_ns > 0:
            ends = self.scene.targets(time_ns - half_ns), self.scene.targets(time_ns + half_ns)
        left, right = (self._seen(view, targets, ends) for view in self.views)
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
