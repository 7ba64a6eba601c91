"""Resection: one view's parameters from known targets, with a prior on all of them (paper 3.6)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import View, parameter_derivatives, project

Array = NDArray[np.float64]

PRIOR_SIGMA = np.array(
    [
        *(0.8, 15.0, 15.0, 0.5, 0.5, 0.5, 100.0, 100.0, 100.0),
        *(0.01, 0.01, 2e-3, 5e-5, 1e-6, 8e-4, 8e-4, 8e-4, 8e-4),
    ]
)
"""Prior σ of a view about its nominal one, in the order of `PARAMETERS`; its position is hardly known."""
_SETTLED = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Resection:
    """Result of a resection.

    Attributes:
        view: The view.
        residual_px: (N, 2) observed minus computed; NaN where a target lies behind the camera.
    """

    view: View
    residual_px: Array

    @property
    def distance_px(self) -> Array:
        """(N,) length of the residuals; infinite behind the camera."""
        distance: Array = np.linalg.norm(self.residual_px, axis=1)
        return np.where(np.isnan(distance), np.inf, distance)


def resect(
    start: View,
    xyz_mm: Array,
    xy_px: Array,
    sigma_px: float,
    *,
    prior: View | None = None,
    most_steps: int = 12,
) -> Resection:
    """Find the view that sees N targets where they were seen, robustly against outliers.

    Every parameter is pulled toward the prior by its `PRIOR_SIGMA`, so any number of targets and any frame,
    even a planar one, give a result. It is accurate enough to tell targets apart; measuring needs the
    adjustment.

    Args:
        start: The view to start from.
        xyz_mm: (N, 3) targets.
        xy_px: (N, 2) frame pixels.
        sigma_px: Standard deviation of an image coordinate; residuals far beyond it are weighted down.
        prior: Centre of the prior; None for the start.
        most_steps: Greatest number of iterations; fewer if it converges.
    """
    middle, view = (prior or start).vector(), start
    for _ in range(most_steps):
        step = _step(view, middle, xyz_mm, xy_px, sigma_px)
        view = view.with_vector(view.vector() + step * PRIOR_SIGMA)
        if np.abs(step).max() < _SETTLED:
            break
    return Resection(view, xy_px - project(view, xyz_mm))


def _step(view: View, middle: Array, xyz_mm: Array, xy_px: Array, sigma_px: float) -> Array:
    """(18,) Gauss–Newton step, in units of `PRIOR_SIGMA`."""
    misfit = xy_px - project(view, xyz_mm)
    weight = _weight(misfit, sigma_px)[:, np.newaxis]
    seen = weight[:, 0] > 0
    slopes = parameter_derivatives(view, xyz_mm[seen]) * PRIOR_SIGMA * weight[seen, :, np.newaxis]
    flat, whitened = slopes.reshape(-1, len(PRIOR_SIGMA)), (misfit * weight)[seen].ravel()
    off = (view.vector() - middle) / PRIOR_SIGMA
    return np.linalg.solve(flat.T @ flat + np.eye(len(PRIOR_SIGMA)), flat.T @ whitened - off)


def _weight(misfit: Array, sigma_px: float) -> Array:
    """(N,) square roots of Cauchy weights, in 1/px; zero behind the camera."""
    square = (misfit * misfit).sum(axis=1) / sigma_px**2
    # Cauchy's weight is one half at 3 σ.
    weight: Array = 1.0 / (sigma_px * np.sqrt(1.0 + square / 9.0))
    return np.where(np.isnan(weight), 0.0, weight)
