"""Network: the input of an adjustment, image points of targets and prior knowledge of their positions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import View
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]
_HINT = "this is a bug in the caller: each target may occur once per view, and every σ must be above 0"


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """M image points of T targets in V views.

    Attributes:
        views: The views with start values; parameters that are not adjusted keep them.
        view: (M,) intp, index of the view that an image point lies in.
        target: (M,) intp, index of its target, at most once per view.
        xy_px: (M, 2) float64, frame pixels.
        sigma_px: (M, 2) float64, standard deviations, above 0.
        target_mm: (T, 3) float64, given positions of the targets, in the object's frame.
        target_sigma_mm: (T, 3) float64, their standard deviation: 0 if held, infinite if unknown (`target_mm`
            is then the start value).
        ids: (T,) ids of the targets for messages; None: their indices.
        camera: (V,) intp, virtual camera that a view is of, where one sees the calibration frame in several
            poses; None: each view is of its own.
        among_corrected: True for residuals between ideal points and corrected observed ones, as programs form
            them whose polynomial is a correction, instead of between points of the picture.

    Raises:
        MeasurementError: Shapes, indices or standard deviations are inconsistent.
    """

    views: tuple[View, ...]
    view: NDArray[np.intp]
    target: NDArray[np.intp]
    xy_px: Array
    sigma_px: Array
    target_mm: Array
    target_sigma_mm: Array
    ids: NDArray[np.int32] | None = None
    among_corrected: bool = False
    camera: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        count, targets = len(self.view), len(self.target_mm)
        if not (len(self.target) == count and self.xy_px.shape == self.sigma_px.shape == (count, 2)):
            raise MeasurementError(
                f"{count} image points come with other numbers of targets, positions or σ", _HINT
            )
        if not (self.target_mm.shape == self.target_sigma_mm.shape == (targets, 3)):
            raise MeasurementError(f"{targets} targets come with another number of σ", _HINT)
        if count and not (self.view.min() >= 0 and self.view.max() < len(self.views)):
            raise MeasurementError(f"an image point lies in none of the {len(self.views)} views", _HINT)
        if count and not (self.target.min() >= 0 and self.target.max() < targets):
            raise MeasurementError(f"an image point belongs to none of the {targets} targets", _HINT)
        if len(np.unique(self.view * targets + self.target)) < count:
            raise MeasurementError("a target has two image points in one view", _HINT)
        if self.among_corrected and any(view.polynomial == "distortion" for view in self.views):
            raise MeasurementError(
                "residuals among corrected points need views whose polynomial is a correction",
                'set polynomial="correction" in all of them',
            )
        known = np.isfinite(self.xy_px).all() and np.isfinite(self.target_mm).all()
        if not (known and (self.sigma_px > 0).all() and (self.target_sigma_mm >= 0).all()):
            raise MeasurementError("a position or a standard deviation is out of range or not finite", _HINT)

    def __len__(self) -> int:
        return len(self.view)

    def id_of(self, target: int) -> int:
        """Id of a target by its index, as people know it."""
        return target if self.ids is None else int(self.ids[target])

    def cameras(self, view: NDArray[np.intp] | int) -> NDArray[np.intp]:
        """Virtual cameras of views by their index, in the same shape."""
        return np.asarray(view) if self.camera is None else self.camera[view]

    @property
    def sightings(self) -> NDArray[np.intp]:
        """(T,) number of views in which a target was seen."""
        return np.bincount(self.target, minlength=len(self.target_mm))

    @property
    def undetermined(self) -> NDArray[np.bool_]:
        """(T,) True for targets seen, but in too few views for the unknown part of their position."""
        lacking: NDArray[np.bool_] = 2 * self.sightings < np.isinf(self.target_sigma_mm).sum(axis=1)
        return lacking & (self.sightings > 0)

    def select(self, chosen: NDArray[np.bool_]) -> "Network":
        """Select image points (M,), keeping all targets and views."""
        return replace(
            self,
            view=self.view[chosen],
            target=self.target[chosen],
            xy_px=self.xy_px[chosen],
            sigma_px=self.sigma_px[chosen],
        )

    def starting_from(self, views: Sequence[View]) -> "Network":
        """Copy with other start values."""
        return replace(self, views=tuple(views))
