"""Where the targets must appear in the next field."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig, View, linearise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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
        count = self.image_px.shape[2]
        if not len(xy_px):
            return np.full(count, -1)
        off = xy_px.T[:, np.newaxis] - self.image_px[:, view, :, np.newaxis]
        off *= 1.0 / self.reach_px[:, view, :, np.newaxis]
        off *= off
        away = off[0] + off[1]
        targets = np.arange(count)
        blob = away.argmin(axis=1)
        own = (away[targets, blob] <= 1.0) & (away.argmin(axis=0)[blob] == targets)
        return np.where(own, blob, -1)

    def windows(self, views: Sequence[View]) -> Array:
        """(K, 4) x0, y0, x1, y1 in frame pixels: all places within reach that lie in a view's half."""
        # What is infinite stays so, and clipping leaves nothing between the edges of such a window.
        low, high = self.image_px - self.reach_px, self.image_px + self.reach_px
        boxes = np.concatenate([low, high]).transpose(1, 2, 0)
        for view, of_view in zip(views, boxes, strict=True):
            np.clip(of_view[:, ::2], view.first_column - 0.5, view.end_column - 0.5, out=of_view[:, ::2])
        flat = boxes.reshape(-1, 4)
        return flat[flat[:, 0] < flat[:, 2]]
