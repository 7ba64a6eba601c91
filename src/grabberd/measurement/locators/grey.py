"""What the locators for more than 1 bit have in common."""

from grabberd.field import BIT_DEPTHS
from grabberd.measurement.locators.centroid import background_in
from grabberd.measurement.locators.locator import Seen

GREY = tuple(bits for bits in BIT_DEPTHS if bits > 1)
"""The bit depths that they are meant for."""


def noise_of(seen: Seen) -> float:
    """Standard deviation of a pixel in grey values: as set, or as the background shows it."""
    known = seen.settings.noise_levels
    return background_in(seen.packed).noise if known is None else known
