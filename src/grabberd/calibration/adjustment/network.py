"""What an adjustment is given: pictures of targets, and what is known of their places."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError
from grabberd.geometry import View

Array = NDArray[np.float64]
_HINT = "this is a fault of what was handed over: every target at most once a view, every σ above 0"


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """M image points of T targets in V views.

    Attributes:
        views: the views with the values to start from; parameters that are not adjusted keep them.
        view: (M,) intp, index of the view that an image point lies in.
        target: (M,) intp, index of its target; a target is at most once in a view.
        xy_px: (M, 2) float64, frame pixels.
        sigma_px: (M, 2) float64, standard deviations, above 0.
        target_mm: (T, 3) float64, where the targets are said to be, in the object's frame.
        target_sigma_mm: (T, 3) float64, how well that is known: 0 held, infinite not at all (then
            `target_mm` is where to start from).

    Raises:
        MeasurementError: shapes, indices or standard deviations contradict each other.
    """

    views: tuple[View, ...]
    view: NDArray[np.intp]
    target: NDArray[np.intp]
    xy_px: Array
    sigma_px: Array
    target_mm: Array
    target_sigma_mm: Array

    def __post_init__(self) -> None:
        count, targets = len(self.view), len(self.target_mm)
        if not (len(self.target) == count and self.xy_px.shape == self.sigma_px.shape == (count, 2)):
            raise MeasurementError(f"{count} image points have other numbers of targets, places or σ", _HINT)
        if not (self.target_mm.shape == self.target_sigma_mm.shape == (targets, 3)):
            raise MeasurementError(f"{targets} targets have another number of σ", _HINT)
        if count and not (self.view.min() >= 0 and self.view.max() < len(self.views)):
            raise MeasurementError(f"an image point lies in none of the {len(self.views)} views", _HINT)
        if count and not (self.target.min() >= 0 and self.target.max() < targets):
            raise MeasurementError(f"an image point belongs to none of the {targets} targets", _HINT)
        if len(np.unique(self.view * targets + self.target)) < count:
            raise MeasurementError("a target has two image points in one view", _HINT)
        known = np.isfinite(self.xy_px).all() and np.isfinite(self.target_mm).all()
        if not (known and (self.sigma_px > 0).all() and (self.target_sigma_mm >= 0).all()):
            raise MeasurementError("a place or a standard deviation is no possible number", _HINT)

    def __len__(self) -> int:
        return len(self.view)

    @property
    def sightings(self) -> NDArray[np.intp]:
        """(T,) in how many views a target was seen."""
        return np.bincount(self.target, minlength=len(self.target_mm))

    @property
    def undetermined(self) -> NDArray[np.bool_]:
        """(T,) which targets were seen, but not often enough for what is not known of their place."""
        lacking: NDArray[np.bool_] = 2 * self.sightings < np.isinf(self.target_sigma_mm).sum(axis=1)
        return lacking & (self.sightings > 0)

    def select(self, chosen: NDArray[np.bool_]) -> "Network":
        """The same targets and views with the image points (M,) chosen."""
        return replace(
            self,
            view=self.view[chosen],
            target=self.target[chosen],
            xy_px=self.xy_px[chosen],
            sigma_px=self.sigma_px[chosen],
        )

    def starting_from(self, views: Sequence[View]) -> "Network":
        """The same with other values to start from."""
        return replace(self, views=tuple(views))
