"""Background of a picture: its level and noise."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PROGRESSIVE, PackedField, unpack

LEAST_NOISE = 12**-0.5
"""Standard deviation of rounding to whole grey values, the least that any picture has."""
QUARTILE = 0.6745
"""Distance of the quartiles from the mean of a normal distribution, in σ."""
SAMPLED_EVERY_PX = 32
"""Frame lines between those sampled for the background."""


class Background(NamedTuple):
    """Grey level behind the targets, and its standard deviation `noise`."""

    level: float
    noise: float


def background_of(histogram: NDArray[np.integer]) -> Background:
    """Estimate the background from a histogram of grey values (256, or fewer coarse levels).

    The background must fill more than half of the picture. Targets brighten only the upper side, so the noise
    is taken from the lower quartile; if black is clipped at 0, from the upper one.
    """
    cumulated = np.cumsum(histogram, dtype=np.float64)
    quarters = cumulated[-1] * np.array([0.25, 0.5, 0.75])
    lower, level, upper = np.interp(quarters, np.append(0.0, cumulated), np.arange(len(histogram) + 1) - 0.5)
    clipped = histogram[0] > quarters[0]
    noise = ((upper - level) if clipped else (level - lower)) / QUARTILE
    return Background(max(0.0, float(level)), max(LEAST_NOISE, float(noise)))


def background_in(packed: PackedField) -> Background:
    """Estimate the background from some of the delivered lines; interpolated ones have less noise."""
    first = 0 if packed.parity == PROGRESSIVE else packed.parity
    lines = packed.data[:, first :: SAMPLED_EVERY_PX // packed.y_step]
    step = 256 >> packed.bits
    levels = unpack(replace(packed, data=lines)).luma // step
    level, noise = background_of(np.bincount(levels.ravel(), minlength=2**packed.bits))
    return Background((level + 0.5) * step - 0.5, noise * step)
