"""A light that goes on and off in the picture: where it might be, and when it was on.

A target that moves also darkens one place and lights another, so whether a place is the light is decided by
who knows when it was on; here are only the places at which there are two states and little between.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PackedField, unpack

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
    lit: NDArray[np.bool_]
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
