"""The image of the light."""

import numpy as np

from grabberd_fake.discs import Ellipses
from grabberd_fake.light_options import LightOptions
from grabberd_fake.optics import HALF, Array


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
