"""Noise of a picture, from its background, and the pointing σ that noise and quantisation cause (paper 3.5).

The σ of a blob's centre follows from its own pixels, without line jitter. A target's sub-pixel phase is
effectively random, so the quantisation error is given as its RMS over that phase. In y it depends strongly on
whether the blob's height is near a whole or a half number of rows; the mean over heights is given here. For a
mixture of sizes it is within a factor 1.35 in x and 1.6 in y of the true RMS; for one exact size, y may be
off by 2.5.

A light that goes on and off in the picture: where it might be, and when it was on.

A target that moves also darkens one place and lights another, so whether a place is the light is decided by
who knows when it was on; here are only the places at which there are two states and little between.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Mask
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


NOISE_SHARED_BY_DOUBLED_ROWS = 1.25
"""Interpolated rows have no noise of their own, so it averages out less than the number of rows suggests."""
GREY_SHARE_OF_BINARY = (0.4, 1.4)
"""Error in x, y of cutting off at the threshold, in binary errors times the threshold's relative height."""
MEAN_OF_PEAK = 0.65
"""Mean weight of a blurred disc's pixels as a share of the highest."""


def binary_sigma_px(area_px: Array, y_step: int, *, doubled: bool) -> Array:
    """Compute the standard deviation of a centre whose pixels are weighted equally.

    Intact rows: sx = .2122 √(py/D), sy = .2122 py/√D with py = `y_step`. Doubled rows (py 1): .105 and .109
    px at D = 5 and proportional to 1/√D, slightly worse than real rows would be.

    Args:
        area_px: (N,) float64, square frame pixels; D is the diameter of a disc of this area.
        y_step: frame lines from row to row.
        doubled: True if every other row has been interpolated.

    Returns:
        (N, 2) float64, x and y, frame pixels.
    """
    root = np.sqrt(np.sqrt(4 / np.pi * area_px))
    x, y = (0.235, 0.244) if doubled else (0.2122 * y_step**0.5, 0.2122 * y_step)
    return np.stack([x / root, y / root], axis=1)


def grey_sigma_px(
    area_px: Array, weight: Array, y_step: int, *, doubled: bool, noise: float, threshold_height: float
) -> Array:
    """Compute the standard deviation of a centre weighted with the grey value above the threshold.

    Noise: s = √(Σ Δ²) sn / Σ(g−T), which for a disc is .282 √py (W/R)² sn/C with W the radius of its
    `area_px` and C π R²/py = Σ(g−T). Cut-off: a share of the binary error proportional to the threshold's
    relative height.

    Args:
        area_px: (N,) float64, square frame pixels above the threshold.
        weight: (N,) float64, Σ(g−T) over the pixels, grey values.
        y_step: frame lines from row to row.
        doubled: True if every other row has been interpolated.
        noise: sn, standard deviation of a pixel, grey values.
        threshold_height: T above the background, grey values.

    Returns:
        (N, 2) float64, x and y, frame pixels.
    """
    shared = NOISE_SHARED_BY_DOUBLED_ROWS if doubled else 1.0
    from_noise = shared * noise * area_px / (np.sqrt(4 * np.pi * y_step) * weight)
    peak = threshold_height + weight * y_step / (area_px * MEAN_OF_PEAK)
    binary = binary_sigma_px(area_px, y_step, doubled=doubled)
    cut_off = (threshold_height / peak)[:, np.newaxis] * GREY_SHARE_OF_BINARY * binary
    return np.hypot(from_noise[:, np.newaxis], cut_off)


TILE_PX = 8
"""Side of the tiles that a field is looked at by, in columns and in rows of the field: the light of a diode
at the picture's edge covers a good part of one."""
LARGEST_LEVEL = 255.0

_LEAST_CONTRAST = 0.03
"""Difference of the states as a share of full scale: two of a tile's 64 pixels at 1 bit."""
_LEAST_DISTINCT = 0.8
"""Mean distance from the middle of both states, in halves of their difference: of a mere slope it is .5."""
_LEAST_CHANGES = 6
_MOST_PLACES = 400
_ALIKE = 0.9

Levels = NDArray[np.float32]


class FlashingPlace(NamedTuple):
    """A place with two states.

    Attributes:
        x_px: Column of its middle, frame pixels; `y_px`: its frame line.
        lit: (F,) True for the fields in which it is bright.
        contrast: Difference of the states as a share of full scale.
    """

    x_px: float
    y_px: float
    lit: Mask
    contrast: float


def tile_levels(packed: PackedField) -> Levels:
    """(rows / 8, columns / 8) mean grey value of every whole tile, as a share of full scale."""
    luma = unpack(packed).luma
    rows, columns = luma.shape[0] // TILE_PX, luma.shape[1] // TILE_PX
    tiles = luma[: rows * TILE_PX, : columns * TILE_PX].reshape(rows, TILE_PX, columns, TILE_PX)
    return tiles.mean(axis=(1, 3), dtype=np.float32) / np.float32(LARGEST_LEVEL)


def flashing_places(levels: Levels, y_step: int) -> list[FlashingPlace]:
    """Places that are either bright or dark, those with the greatest contrast first.

    Args:
        levels: (F, rows, columns) `tile_levels` of F fields, in their order.
        y_step: Frame lines from row to row of the fields.
    """
    flat = levels.reshape(len(levels), -1)
    dark, bright = np.percentile(flat, (5, 95), axis=0)
    contrast, middle = bright - dark, (bright + dark) / 2
    lit = flat > middle
    distinct = np.abs(flat - middle).mean(axis=0) / np.maximum(contrast / 2, 1e-6)
    changes = (lit[1:] != lit[:-1]).sum(axis=0)
    good = (contrast >= _LEAST_CONTRAST) & (distinct >= _LEAST_DISTINCT) & (changes >= _LEAST_CHANGES)
    order = np.flatnonzero(good)
    order = order[np.argsort(-contrast[order], kind="stable")][:_MOST_PLACES]
    return [_place(flat, int(tile), levels.shape[2], y_step) for tile in order]


def _place(flat: Levels, tile: int, columns: int, y_step: int) -> FlashingPlace:
    """A tile and those beside it that brighten with it: a light seldom lies within one."""
    row, column = divmod(tile, columns)
    rows, across = np.divmod(np.arange(flat.shape[1]), columns)
    beside = np.flatnonzero((np.abs(rows - row) <= 1) & (np.abs(across - column) <= 1))
    own = flat[:, tile] - flat[:, tile].mean()
    others = flat[:, beside] - flat[:, beside].mean(axis=0)
    norm = np.sqrt((others**2).sum(axis=0) * (own @ own))
    alike = beside[(own @ others) >= _ALIKE * np.maximum(norm, 1e-9)]
    level = flat[:, alike].sum(axis=1)
    dark, bright = np.percentile(level, (5, 95))
    weight = np.percentile(flat[:, alike], 95, axis=0) - np.percentile(flat[:, alike], 5, axis=0)
    middle = TILE_PX * (np.array([across[alike], rows[alike]]) @ (weight / weight.sum()) + 0.5) - 0.5
    lit = level > (dark + bright) / 2
    return FlashingPlace(float(middle[0]), float(middle[1] * y_step), lit, float(bright - dark))
