"""Prediction of target images in the next field, and assignment of the blobs near them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, linearise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

FEW_PAIRS = 1 << 15
"""Number of target–blob pairs up to which comparing all is faster than finding those near each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted images of M targets in V views.

    Attributes:
        image_px: (2, V, M) predicted images, frame pixels x and y; infinite behind a camera.
        reach_px: (2, V, M) greatest distance from there at which they may appear.
    """

    image_px: Array
    reach_px: Array

    @classmethod
    def of(
        cls, rig: Rig, places_mm: Array, sigma_mm: Array, sigma_px: Array | float, gate: float
    ) -> "Prediction":
        """Predict images from positions and their uncertainty.

        Args:
            rig: The views.
            places_mm: (M, 3) predicted positions.
            sigma_mm: (M,) their standard deviation in each coordinate.
            sigma_px: Standard deviation of a blob's image; broadcasts against (2, V, M).
            gate: Greatest deviation of a target, in standard deviations.
        """
        image, slopes = linearise(rig, places_mm)
        reach = gate * np.hypot(np.sqrt((slopes * slopes).sum(axis=2)) * sigma_mm, sigma_px)
        before = np.isfinite(image)
        return cls(np.where(before, image, np.inf), np.where(before, reach, 1.0))

    def nearest(self, view: int, xy_px: Array) -> Indices:
        """Assign a blob to each target: (M,) indices, −1 for none.

        A blob is assigned to a target if it lies within reach of the predicted image and each is the other's
        nearest, measured in units of the reach.

        Args:
            view: Index of the view.
            xy_px: (N, 2) blobs of that view.
        """
        image, reach = self.image_px[:, view], self.reach_px[:, view]
        if not (len(xy_px) and image.shape[1]):
            return np.full(image.shape[1], -1)
        return (_of_all if image.shape[1] * len(xy_px) <= FEW_PAIRS else _of_those_beside)(
            image, reach, xy_px.T
        )


def _of_all(image: Array, reach: Array, blobs: Array) -> Indices:
    """Compare every target (2, M) with every blob (2, N)."""
    off = blobs[:, np.newaxis] - image[:, :, np.newaxis]
    off *= 1.0 / reach[:, :, np.newaxis]
    off *= off
    away = off[0] + off[1]
    targets = np.arange(image.shape[1])
    blob = away.argmin(axis=1)
    own = (away[targets, blob] <= 1.0) & (away.argmin(axis=0)[blob] == targets)
    return np.where(own, blob, -1)


def _of_those_beside(image: Array, reach: Array, blobs: Array) -> Indices:
    """Do the same in time linear in the number of targets."""
    target, blob = _beside(image, reach, blobs)
    off = (blobs[:, blob] - image[:, target]) * (1.0 / reach[:, target])
    away = (off * off).sum(axis=0)
    within = np.flatnonzero(away <= 1.0)
    target, blob, away = target[within], blob[within], away[within]
    both = _least(away, target, blob), _least(away, blob, target)
    mutual = np.intersect1d(*both, assume_unique=True)
    assigned = np.full(image.shape[1], -1)
    assigned[target[mutual]] = blob[mutual]
    return assigned


def _beside(image: Array, reach: Array, blobs: Array) -> tuple[Indices, Indices]:
    """Targets (P,) and blobs (P,) of all pairs that may be within reach, and some more.

    Blobs are sorted into cells the size of the farthest reach, so that a target's candidates are in nine
    cells.

    Args:
        image: (2, M) predicted images of the targets.
        reach: (2, M) their reach.
        blobs: (2, N) their positions, frame pixels.
    """
    targets = np.flatnonzero(np.isfinite(image).all(axis=0))
    if not (len(targets) and blobs.shape[1]):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    first = blobs.min(axis=1, keepdims=True)
    extent = np.maximum(np.ptp(blobs, axis=1, keepdims=True), 1.0)
    # Not below a 1024th of the extent, or a tiny reach would make millions of cells.
    cell = np.maximum(reach[:, targets].max(axis=1, keepdims=True), extent / 1024)
    columns, rows = (int(one) + 1 for one in (extent / cell)[:, 0])
    x, y = ((blobs - first) / cell).astype(np.int64)
    order = (y * columns + x).argsort(kind="stable")
    key = (y * columns + x)[order]
    at = np.floor((image[:, targets] - first) / cell).clip(-2, [[columns + 1], [rows + 1]]).astype(np.int64)
    parts = []
    for row in (at[1] - 1, at[1], at[1] + 1):
        low, high = (at[0] - 1).clip(0, columns), (at[0] + 1).clip(-1, columns - 1)
        inside = (row >= 0) & (row < rows) & (low <= high)
        begin = key.searchsorted(row * columns + low)
        number = np.where(inside, key.searchsorted(row * columns + high, side="right") - begin, 0)
        index = np.arange(int(number.sum())) - np.repeat(number.cumsum() - number - begin, number)
        parts.append((np.repeat(targets, number), order[index]))
    target, blob = (np.concatenate(some) for some in zip(*parts, strict=True))
    return target, blob


def _least(away: Array, own: Indices, other: Indices) -> Indices:
    """Nearest pair for each `own`; among equally near ones that with the first `other`."""
    order = np.lexsort((other, away, own))
    is_first = np.append(True, own[order][1:] != own[order][:-1])[: len(order)]
    least: Indices = order[is_first]
    return least
