"""Places and points beside the truth: what is found, what is wrong, and how far the found lies off."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR_PX = 3.0
"""A place further from every target than this is none of them; targets are 20 px apart."""
UNNAMED = -1


class Pointing(NamedTuple):
    """RMS errors of the places found; targets found, of how many; and places that are no target."""

    x_px: float
    y_px: float
    found: int
    of: int
    wrong: int


class Pairs(NamedTuple):
    """What one field's points were made of: frame pixels (N, 2) in both views, and the points (N, 3).

    `target` (N,) says which target a point is held to be, as an index of the truth, or `UNNAMED`.
    """

    left_px: Array
    right_px: Array
    xyz_mm: Array
    target: NDArray[np.intp]


class PointErrors(NamedTuple):
    """RMSE of the right points, and how many are right, of how many there are to be, and wrong."""

    x_mm: float
    y_mm: float
    z_mm: float
    xyz_mm: float
    right: int
    of: int
    wrong: int


def pointing(fields: Sequence[Array], truth_px: Array) -> Pointing:
    """Of every field's places (N, 2) beside the targets' (M, 2).

    A target is found where it and a place are each other's nearest; all other places are wrong.
    """
    errors, wrong = [], 0
    for places in fields:
        target = nearest(places, truth_px)
        found = (target != UNNAMED) & (nearest(truth_px, places)[target] == np.arange(len(places)))
        errors.append(places[found] - truth_px[target[found]])
        wrong += int((~found).sum())
    error = np.concatenate(errors)
    x_px, y_px = rms(error)
    return Pointing(x_px, y_px, len(error), len(truth_px) * len(fields), wrong)


def point_errors(fields: Sequence[Pairs], truth_px: Array, truth_mm: Array) -> PointErrors:
    """Of every field's points, with (2, M, 2) places of the targets in both views and (M, 3) in space.

    A point is right where both its places are those of one target, and of the one that it is held to be.
    """
    errors, wrong = [], 0
    for pairs in fields:
        left, right = nearest(pairs.left_px, truth_px[0]), nearest(pairs.right_px, truth_px[1])
        good = (left == right) & (left != UNNAMED)
        good &= (pairs.target == UNNAMED) | (pairs.target == left)
        errors.append(pairs.xyz_mm[good] - truth_mm[left[good]])
        wrong += int((~good).sum())
    error = np.concatenate(errors)
    axes = rms(error)
    total_mm = float(np.hypot.reduce(axes))
    return PointErrors(*axes, total_mm, len(error), len(truth_mm) * len(fields), wrong)


def nearest(places: Array, among: Array) -> NDArray[np.intp]:
    """(N,) index of the nearest of (M, 2) to each of (N, 2), or `UNNAMED` where none is near."""
    if not len(among):
        return np.full(len(places), UNNAMED)
    distance = np.hypot(*(places[:, np.newaxis] - among).transpose(2, 0, 1))
    return np.where(distance.min(axis=1) < NEAR_PX, distance.argmin(axis=1), UNNAMED)


def rms(errors: Array) -> list[float]:
    """Of each column; NaN of none."""
    if not len(errors):
        return [float("nan")] * errors.shape[1]
    return [float(value) for value in np.sqrt((errors**2).mean(axis=0))]
