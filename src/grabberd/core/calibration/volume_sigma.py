"""Predicted σ of X, Y, Z over the volume of the calibration frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.adjustment import Adjustment, propagate
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.geometry import PARAMETERS, LocalField, Rig, View, project_all

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class VolumeSigma:
    """Covariances on a grid of planes, from the lowest Z up; NaN where fewer than two views see the point.

    Attributes:
        xyz_mm: (planes, rows, columns, 3): rows along X, columns along Y.
        pointing_mm2: (planes, rows, columns, 3, 3) covariance from one field's image points.
        calibration_mm2: Likewise, from the calibration; not reduced by averaging.
    """

    xyz_mm: Array
    pointing_mm2: Array
    calibration_mm2: Array

    @property
    def sigma_mm(self) -> Array:
        """(planes, rows, columns, 3) total σ of X, Y, Z."""
        return _sigma(self.pointing_mm2 + self.calibration_mm2)

    @property
    def calibration_sigma_mm(self) -> Array:
        """(planes, rows, columns, 3) σ of X, Y, Z from the calibration alone."""
        return _sigma(self.calibration_mm2)


def volume_sigma(
    adjusted: Adjustment,
    sigma_px: tuple[float, float] | None = None,
    shape: tuple[int, int, int] = (3, 12, 9),
    local_fields: Sequence[LocalField | None] = (),
) -> VolumeSigma:
    """Predict the σ of points over the bounding box of the targets.

    Args:
        adjusted: The calibration.
        sigma_px: Pointing σ in x and y; by default that of the calibration's own image points.
        shape: Number of planes of Z, rows along X, columns along Y.
        local_fields: Local fields of the views, whose σ then enters the calibration's share.
    """
    sigma = np.array(sigma_px or adjusted.sigma0 * np.sqrt(np.mean(adjusted.network.sigma_px**2, axis=0)))
    grid = _grid(adjusted.xyz_mm, shape)
    flat = grid.reshape(-1, 3)
    xy = project_all(Rig.of_views(adjusted.views), flat)
    seen = np.array([_sees(view, xy[:, index]) for index, view in enumerate(adjusted.views)])
    good = seen.sum(axis=0) > 1
    pointing, share = np.full((2, len(flat), 3, 3), np.nan)
    if good.any():
        network = _pictures(adjusted.views, flat[good], xy[:, :, good], seen[:, good], sigma)
        spread = propagate(network, adjusted.parameter_covariance)
        pointing[good] = spread.pointing_mm2
        share[good] = spread.calibration_mm2 + _field_share(local_fields, xy[:, :, good], spread.influence)
    return VolumeSigma(grid, pointing.reshape(*shape, 3, 3), share.reshape(*shape, 3, 3))


def _field_share(local_fields: Sequence[LocalField | None], xy: Array, influence: Array) -> Array:
    """(N, 3, 3) share of the local fields: an image error moves a point as its view's principal point
    does.
    """
    share = np.zeros((len(influence), 3, 3))
    for index, local_field in enumerate(local_fields):
        if local_field is not None:
            first = index * len(PARAMETERS) + PARAMETERS.index("x0_px")
            moved = influence[:, :, first : first + 2] * local_field.sigma_at(xy[:, index].T)[:, np.newaxis]
            share += moved @ moved.swapaxes(1, 2)
    return share


def _grid(xyz_mm: Array, shape: tuple[int, int, int]) -> Array:
    lowest, highest = xyz_mm.min(axis=0), xyz_mm.max(axis=0)
    planes, rows, columns = shape
    steps = zip(lowest, highest, (rows, columns, planes), strict=True)
    x, y, z = (np.linspace(low, high, number) for low, high, number in steps)
    z, x, y = np.meshgrid(z, x, y, indexing="ij")
    return np.stack([x, y, z], axis=-1)


def _sees(view: View, xy_px: Array) -> NDArray[np.bool_]:
    return view.holds(xy_px.T) & np.isfinite(xy_px).all(axis=0)


def _pictures(views: tuple[View, ...], xyz_mm: Array, xy: Array, seen: Array, sigma: Array) -> Network:
    view, target = np.nonzero(seen)
    points = xy[:, view, target].T
    return Network(
        views, view, target, points, np.broadcast_to(sigma, points.shape), xyz_mm, np.zeros(xyz_mm.shape)
    )


def _sigma(covariance: Array) -> Array:
    return np.sqrt(np.einsum("...kk->...k", covariance))
