"""Centroid locator: the centroid of a blob's pixels (paper eqs. 1, 2), for any number of bits."""

from grabberd.core.measurement.background import background_in
from grabberd.core.measurement.labelling.shapes import grey_centres
from grabberd.core.measurement.locators.locator import Located, Seen
from grabberd.core.measurement.sigma import binary_sigma_px, grey_sigma_px


def locate_by_centroid(seen: Seen) -> Located:
    """Locate by centroids, with all pixels weighted equally at 1 bit, and by g − T with more bits."""
    return _binary(seen) if seen.packed.bits == 1 else _grey(seen)


def _binary(seen: Seen) -> Located:
    packed = seen.packed
    return Located(seen.centroids, binary_sigma_px(seen.area_px, packed.y_step, doubled=packed.is_doubled))


def _grey(seen: Seen) -> Located:
    packed, noise = seen.packed, seen.settings.noise_levels
    centres, weight = grey_centres(packed, seen.runs, seen.label, len(seen.shapes))
    background = background_in(packed)
    sigma = grey_sigma_px(
        seen.area_px,
        weight,
        packed.y_step,
        doubled=packed.is_doubled,
        noise=background.noise if noise is None else noise,
        threshold_height=max(0.0, packed.threshold - background.level),
    )
    return Located(centres, sigma)
