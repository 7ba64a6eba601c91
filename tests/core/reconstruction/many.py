"""Objects of many targets, and what is seen of them."""

from dataclasses import dataclass

import numpy as np

from core.geometry.rigs import calibration
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel, ViewBlobs

SIZE_MM = 110.0, 34.0
SIGMA_PX = 0.1


def grid(count):
    """A plane grid, as large as a liner however many targets it has."""
    rows = round((count / 6) ** 0.5 * 2)
    row, column = np.divmod(np.arange(count, dtype=np.int32), np.int32(-(-count // rows)))
    across, down = (size * (at / at.max() - 0.5) for size, at in zip(SIZE_MM, (column, row), strict=True))
    places = np.stack([across, down, np.zeros(count)], axis=1)
    diameter_mm = min(1.5, 0.3 * min(SIZE_MM[0] / column.max(), SIZE_MM[1] / row.max()))
    target = np.arange(count, dtype=np.int32)
    return ObjectModel("grid", target, places, row, column, diameter_mm, 0.05)


def bent(model, depth_mm):
    """(M, 3) places of a grid that is pressed in, most in the middle."""
    x, y, _ = model.xyz_mm.T
    deflection = depth_mm * np.cos(np.pi * x / SIZE_MM[0]) ** 2 * np.cos(np.pi * y / SIZE_MM[1] / 2)
    return model.xyz_mm - np.stack([0 * x, 0 * y, deflection], axis=1)


@dataclass(frozen=True)
class Sight:
    """Blobs of one view, in disorder, and which target each is; −1 for a false one."""

    blobs: ViewBlobs
    of: np.ndarray


def see(places, view, rng, missing=0.05, false=0.02):
    """What a view sees of targets at these places."""
    seen = np.flatnonzero(rng.random(len(places)) >= missing)
    image = project(calibration().views[view], places)
    extra = rng.uniform(image.min(axis=0), image.max(axis=0), (round(false * len(places)), 2))
    xy = np.concatenate([image[seen] + rng.normal(0, SIGMA_PX, (len(seen), 2)), extra])
    of = np.concatenate([seen, np.full(len(extra), -1)])
    order = rng.permutation(len(xy))
    sigma = np.full_like(xy, SIGMA_PX)
    return Sight(ViewBlobs(xy[order], sigma, np.full(len(xy), 0.05), 3.0), of[order])
