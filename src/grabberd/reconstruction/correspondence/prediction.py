"""Where the targets must appear in the next field."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, View, linearise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

FEW_PAIRS = 1 << 15
"""So many pairs of target and blob are all looked at sooner than those beside each other are found."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The images that M targets must have in V views.

    Attributes:
        places_mm: (M, 3) where the targets must be.
        image_px: (2, V, M) where they must appear, frame pixels x and y; infinite behind a camera.
        reach_px: (2, V, M) how far from there they may appear.
    """

    places_mm: Array
    image_px: Array
    reach_px: Array

    @classmethod
    def of(
        cls, rig: Rig, places_mm: Array, sigma_mm: Array, sigma_px: Array | float, gate: float
    ) -> "Prediction":
        """From places (M, 3), known to `sigma_mm` (M,) in each coordinate, and a blob's σ in px.

        Args:
            rig: the views.
            places_mm: predicted places.
            sigma_mm: their standard deviations.
            sigma_px: of a blob's image; broadcasts against (2, V, M).
            gate: how many standard deviations a target may be off.
        """
        image, slopes = linearise(rig, places_mm)
        reach = gate * np.hypot(np.sqrt((slopes * slopes).sum(axis=2)) * sigma_mm, sigma_px)
        before = np.isfinite(image)
        return cls(places_mm, np.where(before, image, np.inf), np.where(before, reach, 1.0))

    def nearest(self, view: int, xy_px: Array) -> Indices:
        """(M,) index of the blob that is each target's, -1 where there is none.

        A blob is a target's where it lies within reach of its predicted image, no other blob is nearer to
        that, and it is nearer to no other target's; near in units of the reach.

        Args:
            view: index of the view.
            xy_px: (N, 2) the blobs of that view.
        """
        image, reach = self.image_px[:, view], self.reach_px[:, view]
        if not len(xy_px):
            return np.full(image.shape[1], -1)
        return (_of_all if image.shape[1] * len(xy_px) <= FEW_PAIRS else _of_those_beside)(
            image, reach, xy_px.T
        )

    def windows(self, views: Sequence[View]) -> Array:
        """(K, 4) x0, y0, x1, y1 in frame pixels: all places within reach that lie in a view's half."""
        # What is infinite stays so, and clipping leaves nothing between the edges of such a window.
        low, high = self.image_px - self.reach_px, self.image_px + self.reach_px
        boxes = np.concatenate([low, high]).transpose(1, 2, 0)
        for view, of_view in zip(views, boxes, strict=True):
            np.clip(of_view[:, ::2], view.first_column - 0.5, view.end_column - 0.5, out=of_view[:, ::2])
        flat = boxes.reshape(-1, 4)
        return flat[flat[:, 0] < flat[:, 2]]


def _of_all(image: Array, reach: Array, places: Array) -> Indices:
    """Every target (2, M) with every blob (2, N)."""
    off = places[:, np.newaxis] - image[:, :, np.newaxis]
    off *= 1.0 / reach[:, :, np.newaxis]
    off *= off
    away = off[0] + off[1]
    targets = np.arange(image.shape[1])
    blob = away.argmin(axis=1)
    own = (away[targets, blob] <= 1.0) & (away.argmin(axis=0)[blob] == targets)
    return np.where(own, blob, -1)


def _of_those_beside(image: Array, reach: Array, places: Array) -> Indices:
    """The same, in a time that grows with the number of targets, not with its square."""
    target, blob = _beside(image, reach, places)
    off = (places[:, blob] - image[:, target]) * (1.0 / reach[:, target])
    away = (off * off).sum(axis=0)
    within = np.flatnonzero(away <= 1.0)
    target, blob, away = target[within], blob[within], away[within]
    both = _least(away, target, blob), _least(away, blob, target)
    mutual = np.intersect1d(*both, assume_unique=True)
    found = np.full(image.shape[1], -1)
    found[target[mutual]] = blob[mutual]
    return found


def _beside(image: Array, reach: Array, places: Array) -> tuple[Indices, Indices]:
    """Targets (P,) and blobs (P,) of all pairs that may be within reach, and some more.

    Blobs are sorted into cells as large as the farthest reach, so that a target's are in nine of them.

    Args:
        image: (2, M) of the targets.
        reach: (2, M) of them.
        places: (2, N) of the blobs.
    """
    targets = np.flatnonzero(np.isfinite(image).all(axis=0))
    if not (len(targets) and places.shape[1]):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    first = places.min(axis=1, keepdims=True)
    extent = np.maximum(np.ptp(places, axis=1, keepdims=True), 1.0)
    cell = np.maximum(reach[:, targets].max(axis=1, keepdims=True), extent / 1024)
    columns, rows = (int(one) + 1 for one in (extent / cell)[:, 0])
    x, y = ((places - first) / cell).astype(np.int64)
    order = (y * columns + x).argsort(kind="stable")
    key = (y * columns + x)[order]
    at = np.floor((image[:, targets] - first) / cell).clip(-2, [[columns + 1], [rows + 1]]).astype(np.int64)
    parts = []
    for row in (at[1] - 1, at[1], at[1] + 1):
        low, high = (at[0] - 1).clip(0, columns), (at[0] + 1).clip(-1, columns - 1)
        inside = (row >= 0) & (row < rows) & (low <= high)
        begin = key.searchsorted(row * columns + low)
        number = np.where(inside, key.searchsorted(row * columns + high, side="right") - begin, 0)
        place = np.arange(int(number.sum())) - np.repeat(number.cumsum() - number - begin, number)
        parts.append((np.repeat(targets, number), order[place]))
    target, blob = (np.concatenate(some) for some in zip(*parts, strict=True))
    return target, blob


def _least(away: Array, own: Indices, other: Indices) -> Indices:
    """Of all pairs with the same `own` the nearest, of equally near ones that with the first `other`."""
    order = np.lexsort((other, away, own))
    is_first = np.append(True, own[order][1:] != own[order][:-1])[: len(order)]
    least: Indices = order[is_first]
    return least
