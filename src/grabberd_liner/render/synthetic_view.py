"""Synthetic views of a capture's fields, and their fit to the camera's pictures (paper 3.7)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.field import Field, double_lines
from grabberd.core.geometry import Calibration
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.camera import Camera, Raster
from grabberd_liner.analysis.surface.surface import Mesh, Surface
from grabberd_liner.analysis.synthetic import Agreement, SyntheticView, agreement, synthetic_view

Picture = NDArray[np.uint8]

_LEFT, _RIGHT = 0, 1
_HALF_GREY = 128


class SyntheticPair(NamedTuple):
    """Both synthetic views of one field, each painted with the other view's grey values.

    Attributes:
        left: left view with the right one's grey values; `right`: vice versa.
        fit: fit of the left and the right view to the camera's picture; None if nothing can be matched.
        problems: reasons for missing fits, as sentences.
    """

    left: SyntheticView
    right: SyntheticView
    fit: tuple[Agreement | None, Agreement | None]
    problems: tuple[str, ...]


def synthetic_pair(
    surface: Surface, calibration: Calibration, field: Field, *, fitted: bool = True
) -> SyntheticPair:
    """Both synthetic views, every frame line of each half.

    Args:
        surface: the outer face at the field's time.
        calibration: both cameras.
        field: field of grey values, its lines intact or doubled.
        fitted: True to determine the fit.
    """
    whole, cameras = double_lines(field), Camera.both(calibration)
    views = tuple(
        synthetic_view(surface, camera, Raster(camera.columns, range(calibration.lines)), source, whole)
        for camera, source in zip(cameras, cameras[::-1], strict=True)
    )
    fits, problems = list[Agreement | None](), list[str]()
    for camera, view in zip(cameras, views, strict=True):
        try:
            fits.append(agreement(surface, view, field) if fitted else None)
        except AnalysisError as error:
            fits.append(None)
            problems.append(f"{camera.view.name} view: {error.message}")
    return SyntheticPair(views[_LEFT], views[_RIGHT], (fits[_LEFT], fits[_RIGHT]), tuple(problems))


def free_view(
    surface: Surface,
    calibration: Calibration,
    field: Field,
    azimuth_deg: float,
    elevation_deg: float,
    size: tuple[int, int],
) -> SyntheticView:
    """The surface from a free viewpoint, with the left view's grey values, or else the right one's.

    Args:
        surface: the outer face at the field's time.
        calibration: both cameras; the free one is as far away as the left.
        field: field of grey values.
        azimuth_deg: azimuth of the free camera in the xy plane, from x towards y.
        elevation_deg: elevation of the free camera above that plane.
        size: width and height of its picture.
    """
    mesh = Mesh.of(surface)
    shown = mesh.xyz_mm.reshape(-1, 3)[np.unique(mesh.corners())]
    camera = Camera.looking_at(calibration.left, shown.mean(axis=0), azimuth_deg, elevation_deg, *size)
    camera = camera.filling(shown, *size)
    raster, whole = Raster(range(size[0]), range(size[1])), double_lines(field)
    left, right = (
        synthetic_view(surface, camera, raster, source, whole) for source in Camera.both(calibration)
    )
    return left._replace(grey=np.where(left.filled, left.grey, right.grey))


def frame_of(pair: SyntheticPair, calibration: Calibration) -> Array:
    """(lines, columns) both synthetic views at their positions in the frame; NaN where they are empty."""
    frame = np.full((calibration.lines, calibration.columns), np.nan)
    for view in (pair.left, pair.right):
        frame[:, view.raster.columns.start : view.raster.columns.stop] = view.grey
    return frame


def see_through(grey: Array) -> Picture:
    """(lines, columns, 4) uint8: blue, green, red, and alpha, 0 where the view is empty."""
    filled = np.isfinite(grey)
    luma = _rounded(grey)
    return np.dstack([luma, luma, luma, np.where(filled, 255, 0).astype(np.uint8)])


def laid_over(grey: Array, field: Field) -> Picture:
    """(lines, columns, 3) uint8: the camera's picture in red, the model's in cyan: grey where they agree.

    Where the model's is empty, the camera's stays as it is, darker.
    """
    camera, filled = double_lines(field).luma, np.isfinite(grey)
    plain = (camera // 2).astype(np.uint8)
    model = np.where(filled, _rounded(grey), plain)
    return np.dstack([model, model, np.where(filled, camera, plain)])


def difference(grey: Array, field: Field) -> Picture:
    """(lines, columns) uint8: 128 + half of camera minus model; 128 where the model's is empty."""
    return _rounded(_HALF_GREY + (double_lines(field).luma - grey) / 2, _HALF_GREY)


def _rounded(grey: Array, empty: int = 0) -> Picture:
    return np.clip(np.round(np.nan_to_num(grey, nan=empty)), 0, 255).astype(np.uint8)
