"""Identification of targets that one view alone sees: they have an image, but no point.

Round a curved object the outermost columns are hidden from one view or the other. The points of a field
predict where its remaining targets are, well enough to tell their images apart, because neighbours move
alike; along the ray, where the prediction is worst, an image does not change.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.points import Points, SingleViewImages
from grabberd.core.reconstruction.view_blobs import ViewBlobs

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SAME_PX = 0.5
"""Distance within which a blob is the image of a point: the point may be of an earlier run."""


class SingleViewSearch:
    """The search, for one object seen by one rig."""

    def __init__(self, correspondence: Correspondence) -> None:
        self._correspondence = correspondence

    def images(self, points: Points, left: ViewBlobs, right: ViewBlobs) -> SingleViewImages:
        """Identify the images of targets that have no point in this field.

        Args:
            points: The points of the field.
            left: All blobs of the left view.
            right: All blobs of the right view.

        Returns:
            The images beyond doubt. A target with a blob near its predicted image in *both* views is left
            out: had they been of one target, it would have a point.
        """
        lacking, places_mm, sigma_mm = self._lacking(points)
        free = [view.select(_unused(view, points.image_px[:, k])) for k, view in enumerate((left, right))]
        predicted = self._correspondence.predict(places_mm, sigma_mm, self._typical_px(free))
        blob = np.stack([predicted.nearest(k, view.xy_px) for k, view in enumerate(free)])
        alone = np.flatnonzero((blob >= 0).sum(axis=0) == 1)
        of_view = blob[:, alone].argmax(axis=0)
        image_px, sigma_px = np.empty((2, len(alone), 2))
        for k, view in enumerate(free):
            own = view.select(blob[k, alone[of_view == k]])
            image_px[of_view == k], sigma_px[of_view == k] = own.xy_px, self._sigma_px(own)
        return SingleViewImages(
            self._correspondence.model.target[lacking[alone]], of_view, image_px, sigma_px
        )

    def _lacking(self, points: Points) -> tuple[Indices, Array, Array]:
        """Indices (L,) of targets without a point, their predicted places (L, 3), and σ of these (L,).

        Only those that the points predict well enough to tell a target from its neighbours.
        """
        model, judge = self._correspondence.model, self._correspondence.agreement
        seen = np.isin(model.target, points.target)
        displacement = np.zeros_like(model.xyz_mm)
        displacement[seen] = points.xyz_mm - model.xyz_mm[seen]
        expected = judge.field.expect(seen, displacement)
        places_mm, sigma_mm = self._correspondence.expected_places(expected)
        lacking = np.flatnonzero(~seen & (sigma_mm <= judge.settings.trust * judge.pitch_mm))
        return lacking, places_mm[lacking], sigma_mm[lacking]

    def _typical_px(self, views: Sequence[ViewBlobs]) -> float:
        """Typical σ of an image in either view, with what the calibration does not describe."""
        variance = np.concatenate([view.sigma_px.ravel() for view in views]) ** 2
        located = float(variance.mean()) if len(variance) else 0.0
        return float(np.sqrt(located + self._correspondence.settings.unmodelled_px**2))

    def _sigma_px(self, blobs: ViewBlobs) -> Array:
        """(N, 2) σ of the images, with that of the lines on which they lie."""
        jitter_px = self._correspondence.noise.blob_jitter_px if blobs.common_px is None else blobs.common_px
        return np.column_stack([np.hypot(blobs.sigma_px[:, 0], jitter_px), blobs.sigma_px[:, 1]])


def _unused(blobs: ViewBlobs, images_px: Array) -> NDArray[np.bool_]:
    """(N,) True for blobs that are not the image of a point."""
    off = blobs.xy_px[:, np.newaxis] - images_px
    unused: NDArray[np.bool_] = ~((off * off).sum(axis=2) <= _SAME_PX**2).any(axis=1)
    return unused
