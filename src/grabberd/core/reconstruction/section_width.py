"""Section width of the liner: distance between facing targets of the middle row."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Points

MODELS = 16
"""Models whose facing targets are remembered: one for each device."""


class SectionWidth(NamedTuple):
    """Distance between two targets.

    Attributes:
        targets: Their ids.
        width_mm: None if one of them has no point.
        sigma_mm: From pointing and line jitter; the calibration's share is common to all fields.
    """

    targets: tuple[int, int]
    width_mm: float | None
    sigma_mm: float | None


def section_widths(points: Points, model: ObjectModel) -> list[SectionWidth]:
    """Measure the widths across the object's middle row, from the outermost pair of targets inwards.

    Each width is always between the same two targets, so that it can be compared from field to field; which
    pairs the cameras see depends on how far the liner is open.
    """
    pairs = facing_targets(model)
    rows = _rows(points, [target for pair in pairs for target in pair])
    return [_width(points, *found) for found in zip(pairs, rows[::2], rows[1::2], strict=True)]


@lru_cache(MODELS)
def facing_targets(model: ObjectModel) -> list[tuple[int, int]]:
    """Ids of pairs of facing targets in the middle row, the outermost first; found once for each model."""
    rows = np.unique(model.row)
    own = np.flatnonzero(model.row == rows[(len(rows) - 1) // 2])
    ids: list[int] = model.target[own[np.argsort(model.column[own])]].tolist()
    half = len(ids) // 2
    return list(zip(ids[:half], reversed(ids[-half:]), strict=True)) if half else []


def _width(points: Points, pair: tuple[int, int], one: int | None, other: int | None) -> SectionWidth:
    """Width between the points of two targets, by their rows."""
    if one is None or other is None:
        return SectionWidth(pair, None, None)
    apart = points.xyz_mm[other] - points.xyz_mm[one]
    width_mm = math.sqrt(apart @ apart)
    if width_mm == 0:
        return SectionWidth(pair, None, None)
    covariance = points.covariance_mm2[one] + points.covariance_mm2[other]
    variance = float(apart @ covariance @ apart)
    return SectionWidth(pair, width_mm, math.sqrt(variance) / width_mm if variance >= 0 else math.nan)


def _rows(points: Points, targets: list[int]) -> list[int | None]:
    """Row of each target; None if it has no point."""
    found: list[int] = np.searchsorted(points.target, targets).tolist()
    return [
        row if row < len(points) and points.target[row] == target else None
        for row, target in zip(found, targets, strict=True)
    ]
