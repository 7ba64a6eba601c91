"""The centroid of a blob's pixels (paper eqs. 1, 2), for any number of bits."""

from dataclasses import replace

import numpy as np

from grabberd.field import PackedField, unpack
from grabberd.measurement.labelling.shapes import grey_centres
from grabberd.measurement.locators.locator import Located, Seen
from grabberd.measurement.sigma import binary_sigma_px, grey_sigma_px
from grabberd.measurement.threshold.background import Background, background_of

SAMPLED_EVERY_PX = 32
"""The background is looked at on one frame line in so many."""


def locate_by_centroid(seen: Seen) -> Located:
    """Every pixel weighs the same at 1 bit, and g − T with more bits."""
    return _binary(seen) if seen.packed.bits == 1 else _grey(seen)


def _binary(seen: Seen) -> Located:
    return Located(seen.centroids, binary_sigma_px(seen.area_px, seen.packed.y_step))


def _grey(seen: Seen) -> Located:
    packed, noise = seen.packed, seen.settings.noise_levels
    centres, weight = grey_centres(packed, seen.runs, seen.label, len(seen.shapes))
    background = background_in(packed)
    sigma = grey_sigma_px(
        seen.area_px,
        weight,
        packed.y_step,
        noise=background.noise if noise is None else noise,
        threshold_height=max(0.0, packed.threshold - background.level),
    )
    return Located(centres, sigma)


def background_in(packed: PackedField) -> Background:
    """From some of the lines that the camera delivered; interpolated ones have less noise."""
    lines = packed.data[:, packed.parity :: SAMPLED_EVERY_PX // packed.y_step]
    step = 256 >> packed.bits
    levels = unpack(replace(packed, data=lines)).luma // step
    level, noise = background_of(np.bincount(levels.ravel(), minlength=2**packed.bits))
    return Background((level + 0.5) * step - 0.5, noise * step)
