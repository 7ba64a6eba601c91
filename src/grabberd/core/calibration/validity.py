"""Validity of a calibration: σ over each view and over depth, and the cost of a view's movement.

Inside the calibration frame's volume σ rests on targets; outside of it the model is extrapolated, and nothing
has tested that: such places are marked. σ knows of errors that the adjustment had to do with, not of a camera
that moved since: a view's picture is therefore also shifted and turned, and its points intersected anew.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.calibration.adjustment.adjustment import Adjustment, intersect_network, propagate
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.geometry import (
    PARAMETERS,
    LocalField,
    LocalFields,
    Rig,
    View,
    parameter_derivatives,
    project,
    project_all,
    rays,
    rotation_matrix,
)
from grabberd.core.geometry.document_reader import finite


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
    local_fields: LocalFields | tuple[LocalField | None, ...] = (),
) -> VolumeSigma:
    """Predict the σ of points over the bounding box of the targets.

    Args:
        adjusted: The calibration.
        sigma_px: Pointing σ in x and y; by default that of the calibration's own image points.
        shape: Number of planes of Z, rows along X, columns along Y.
        local_fields: Local fields of both views, whose σ then enters the calibration's share.
    """
    sigma = np.array(sigma_px or adjusted.sigma0 * np.sqrt(np.mean(adjusted.network.sigma_px**2, axis=0)))
    grid = _grid(adjusted.xyz_mm, shape)
    flat = grid.reshape(-1, 3)
    pointing, share = sigmas(adjusted.views, adjusted.parameter_covariance, flat, sigma, local_fields)
    return VolumeSigma(grid, pointing.reshape(*shape, 3, 3), share.reshape(*shape, 3, 3))


def sigmas(
    views: tuple[View, ...],
    parameter_covariance: Array,
    xyz_mm: Array,
    sigma_px: Array,
    local_fields: LocalFields | tuple[LocalField | None, ...] = (),
    lines: int | None = None,
) -> tuple[Array, Array]:
    """(N, 3, 3) covariances of points from pointing and from the calibration.

    NaN where fewer than two views see the point.

    Args:
        views: The views.
        parameter_covariance: (18 V, 18 V) of all views' `PARAMETERS`.
        xyz_mm: (N, 3) points.
        sigma_px: (2,) pointing σ in x and y.
        local_fields: Local fields of the views, whose σ then enters the calibration's share.
        lines: Picture height, beyond which a view sees nothing; None: not looked at.
    """
    rig = Rig.of_views(views)
    xy = project_all(rig, xyz_mm)
    seen = _seen(views, xy, lines)
    good = seen.sum(axis=0) > 1
    pointing, share = np.full((2, len(xyz_mm), 3, 3), np.nan)
    if good.any():
        network = network_of(views, xyz_mm[good], xy[:, :, good], seen[:, good], sigma_px)
        spread = propagate(network, parameter_covariance)
        pointing[good] = spread.pointing_mm2
        share[good] = spread.calibration_mm2
        if any(local_fields[:2]):
            rig = replace(rig, local_fields=LocalFields(*local_fields))
            share[good] += _field_share(rig, xy[:, :, good], spread.influence)
    return pointing, share


def seen_by_all(views: tuple[View, ...], xy_px: Array, lines: int) -> Mask:
    """(N,) True for points whose images (2, V, N) lie in their halves of the picture in all views."""
    return np.asarray(_seen(views, xy_px, lines).all(axis=0))


def _field_share(rig: Rig, xy: Array, influence: Array) -> Array:
    """(N, 3, 3) share of the local fields: an image error moves a point as its view's principal point
    does.
    """
    first = PARAMETERS.index("x0_px")
    by_image = influence.reshape(len(influence), 3, 2, -1)[..., first : first + 2]
    errors = rig.local_errors_px(xy)
    assert errors is not None
    moved = np.einsum("nkvc,cven->nke", by_image, errors)
    share: Array = moved @ moved.swapaxes(1, 2)
    return share


def _grid(xyz_mm: Array, shape: tuple[int, int, int]) -> Array:
    lowest, highest = xyz_mm.min(axis=0), xyz_mm.max(axis=0)
    planes, rows, columns = shape
    steps = zip(lowest, highest, (rows, columns, planes), strict=True)
    x, y, z = (np.linspace(low, high, number) for low, high, number in steps)
    z, x, y = np.meshgrid(z, x, y, indexing="ij")
    return np.stack([x, y, z], axis=-1)


def _seen(views: tuple[View, ...], xy_px: Array, lines: int | None) -> Mask:
    """(V, N) True where an image (2, V, N) lies in its view's half of the picture."""
    held = [view.holds(xy_px[:, index].T) for index, view in enumerate(views)]
    on_lines = True if lines is None else (xy_px[1] >= -0.5) & (xy_px[1] < lines - 0.5)
    return np.array(held) & np.isfinite(xy_px).all(axis=0) & on_lines


def network_of(views: tuple[View, ...], xyz_mm: Array, xy_px: Array, seen: Mask, sigma_px: Array) -> Network:
    """Network of points (N, 3) with their images (2, V, N) in the views that see them (V, N)."""
    view, target = np.nonzero(seen)
    points = xy_px[:, view, target].T
    given = np.broadcast_to(sigma_px, points.shape)
    return Network(views, view, target, points, given, xyz_mm, np.zeros(xyz_mm.shape))


def _sigma(covariance: Array) -> Array:
    return np.sqrt(np.einsum("...kk->...k", covariance))


AXES = ("x", "y", "z")
GRID_PX = 40
"""Spacing of the nodes in the picture."""
DEPTHS, _ACROSS = 13, 5
_BEYOND = 0.5
"""Share of the volume's depth that is looked at before and behind it."""
SHIFT_PX, TURN_DEG = 0.1, 0.01


class Volume(NamedTuple):
    """The volume of the calibration frame's targets, and the pointing σ of one field there.

    Attributes:
        low_mm: (3,) least X, Y, Z.
        high_mm: (3,) greatest X, Y, Z.
        pointing_px: σ of one field's image coordinates in x and y.
    """

    low_mm: Array
    high_mm: Array
    pointing_px: tuple[float, float]

    @property
    def middle_mm(self) -> Array:
        """(3,) its middle."""
        return 0.5 * (self.low_mm + self.high_mm)

    def holds(self, xyz_mm: Array) -> Mask:
        """(N,) True for points (N, 3) inside, up to rounding."""
        above, below = xyz_mm >= self.low_mm - 1e-9, xyz_mm <= self.high_mm + 1e-9
        return np.asarray((above & below).all(axis=1))


class Calibrated(NamedTuple):
    """Both views as a calibration knows them.

    Attributes:
        views: Left and right view.
        covariance: (36, 36) of their `PARAMETERS`.
        local_fields: Local fields of the views.
        lines: Picture height in frame lines.
    """

    views: tuple[View, ...]
    covariance: Array
    local_fields: LocalFields
    lines: int


def validity_document(calibrated: Calibrated, volume: Volume) -> dict[str, Any]:
    """σ over each view at the middle of the volume, σ over depth, and the cost of a view's movements.

    The document is that of `CalibrationValidity`; a number is null where not both views see the place.
    """
    return {
        "volume_mm": {
            axis: [float(low), float(high)]
            for axis, low, high in zip(AXES, volume.low_mm, volume.high_mm, strict=True)
        },
        "pointing_px": list(volume.pointing_px),
        "views": [_view_document(calibrated, index, volume) for index in range(len(calibrated.views))],
        "depths": _depths_document(calibrated, volume),
        "movements": [
            _movement_document(calibrated, volume, index, movement)
            for index in range(len(calibrated.views))
            for movement in ("shift_x", "shift_y", "turn_x", "turn_y", "turn_z")
        ],
    }


def projection_sigma(calibrated: Calibrated, index: int, xyz_mm: Array) -> Array:
    """(N, 2) σ in px of where a view shows points (N, 3), from the calibration alone."""
    view, fields = calibrated.views[index], calibrated.local_fields
    field = fields.right if index else fields.left
    own = slice(index * len(PARAMETERS), (index + 1) * len(PARAMETERS))
    slopes = parameter_derivatives(view, xyz_mm)
    variance: Array = np.einsum("nij,jk,nik->ni", slopes, calibrated.covariance[own, own], slopes)
    if field is not None:
        variance += field.sigma_at(project(view, xyz_mm)) ** 2
    return np.sqrt(variance)


def point_sigma(calibrated: Calibrated, volume: Volume, xyz_mm: Array) -> tuple[Array, Array]:
    """(N, 3) σ in mm of points, from the calibration alone and in total; NaN where a view sees nothing."""
    pointing, share = sigmas(
        calibrated.views,
        calibrated.covariance,
        xyz_mm,
        np.array(volume.pointing_px),
        calibrated.local_fields,
        calibrated.lines,
    )
    deviations = (np.sqrt(np.einsum("nkk->nk", one)) for one in (share, pointing + share))
    calibration, total = deviations
    return calibration, total


def moved_view(view: View, movement: str) -> View:
    """A view whose picture has shifted by `SHIFT_PX`, or that has turned by `TURN_DEG` about its own axis."""
    kind, _, axis = movement.partition("_")
    if kind == "shift":
        name = f"{axis}0_px"
        return view.with_vector(view.vector() + SHIFT_PX * (np.array(PARAMETERS) == name))
    angles = np.radians(TURN_DEG) * (np.array(AXES) == axis)
    return view.with_axes(rotation_matrix(*angles.tolist()) @ view.axes)


def movement_errors(calibrated: Calibrated, volume: Volume, index: int, movement: str) -> Array:
    """(9, 3) errors in mm of the middle and the corners of the volume, measured after a view has moved.

    NaN for a corner that a view does not see.
    """
    corners = np.stack(
        np.meshgrid(*np.stack([volume.low_mm, volume.high_mm], axis=1), indexing="ij"), axis=-1
    )
    places = np.concatenate([volume.middle_mm[np.newaxis], corners.reshape(-1, 3)])
    views = list(calibrated.views)
    views[index] = moved_view(views[index], movement)
    xy = project_all(Rig.of_views(views), places)
    seen = seen_by_all(calibrated.views, xy, calibrated.lines)
    errors = np.full(places.shape, np.nan)
    if seen.any():
        every = np.ones((len(views), int(seen.sum())), np.bool_)
        network = network_of(
            calibrated.views, places[seen], xy[:, :, seen], every, np.array(volume.pointing_px)
        )
        errors[seen] = intersect_network(network) - places[seen]
    return errors


def _view_document(calibrated: Calibrated, index: int, volume: Volume) -> dict[str, Any]:
    view = calibrated.views[index]
    columns = _nodes(view.first_column, view.end_column - 1)
    lines = _nodes(0, calibrated.lines - 1)
    xy_px = np.stack(np.meshgrid(columns, lines), axis=-1).reshape(-1, 2)
    places = _on_plane(view, xy_px, float(volume.middle_mm[2]))
    met = np.isfinite(places).all(axis=1)
    projection, total = np.full((len(places), 2), np.nan), np.full((len(places), 3), np.nan)
    projection[met] = projection_sigma(calibrated, index, places[met])
    total[met] = point_sigma(calibrated, volume, places[met])[1]
    shape = len(lines), len(columns)
    return {
        "view": view.name,
        "columns": columns.tolist(),
        "lines": lines.tolist(),
        "z_mm": float(volume.middle_mm[2]),
        "projection_px": _grids(projection, shape),
        "point_mm": _grids(total, shape),
        "inside": volume.holds(places).reshape(shape).tolist(),
    }


def _depths_document(calibrated: Calibrated, volume: Volume) -> dict[str, Any]:
    """Root mean square of σ over planes of the volume's width and height, where both views see them."""
    low, high = volume.low_mm, volume.high_mm
    beyond = _BEYOND * max(float(high[2] - low[2]), 0.25 * float((high - low)[:2].max()))
    depths = np.linspace(low[2] - beyond, high[2] + beyond, DEPTHS)
    x, y = (np.linspace(low[k], high[k], _ACROSS) for k in (0, 1))
    places = np.stack(np.meshgrid(depths, x, y, indexing="ij"), axis=-1)[..., [1, 2, 0]].reshape(-1, 3)
    calibration, total = (
        _mean(one.reshape(DEPTHS, -1, 3)) for one in point_sigma(calibrated, volume, places)
    )
    return {
        "z_mm": depths.tolist(),
        "inside": ((depths >= low[2]) & (depths <= high[2])).tolist(),
        "calibration": {axis: [*map(finite, calibration[:, k])] for k, axis in enumerate(AXES)},
        "total": {axis: [*map(finite, total[:, k])] for k, axis in enumerate(AXES)},
    }


def _movement_document(calibrated: Calibrated, volume: Volume, index: int, movement: str) -> dict[str, Any]:
    errors = movement_errors(calibrated, volume, index, movement)
    length = np.linalg.norm(errors[1:], axis=1)
    worst = errors[1 + int(np.nanargmax(length))] if np.isfinite(length).any() else errors[0] * np.nan
    shift = movement.startswith("shift")
    return {
        "view": calibrated.views[index].name,
        "movement": movement,
        "amount": SHIFT_PX if shift else TURN_DEG,
        "unit": "px" if shift else "deg",
        "middle_mm": _by_axis(errors[0]),
        "corner_mm": _by_axis(worst),
    }


def _mean(sigma_mm: Array) -> Array:
    """(D, 3) root mean square of (D, N, 3), NaN where there is none."""
    count = np.isfinite(sigma_mm).sum(axis=1)
    total = np.nansum(sigma_mm**2, axis=1)
    return np.sqrt(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def _nodes(first: float, last: float) -> Array:
    return np.linspace(first, last, max(2, round((last - first) / GRID_PX) + 1))


def _on_plane(view: View, xy_px: Array, z_mm: float) -> Array:
    """(N, 3) places of pixels on a plane of equal Z; NaN where the ray leads away from it."""
    center, directions = rays(view, xy_px)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (z_mm - center[2]) / directions[:, 2]
        return np.where(reach[:, np.newaxis] > 0, center + reach[:, np.newaxis] * directions, np.nan)


def _grids(values: Array, shape: tuple[int, int]) -> dict[str, Any]:
    return {
        axis: [[finite(one) for one in row] for row in column.reshape(shape)]
        for axis, column in zip(AXES, values.T, strict=False)
    }


def _by_axis(values: Array) -> Mapping[str, float | None]:
    return {axis: finite(value) for axis, value in zip(AXES, values, strict=True)}
