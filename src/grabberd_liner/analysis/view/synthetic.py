"""The synthetic view: the surface as a camera would see it, with the grey values of another view (paper 3.7).

For every pixel a ray is cast onto the estimated surface, and the intersection is looked up in the picture of
the source view. An overlay with the camera's own picture shows whether model, surface and calibration are
right: errors shift one against the other (`registration`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field
from grabberd_liner.analysis.surface.mesh import Mesh
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.analysis.view.camera import Camera
from grabberd_liner.analysis.view.ray_casting import Hits, Raster, cast, nearest

Array = NDArray[np.float64]

_HIDDEN_MM = 1.0
"""A point is hidden from a camera if the mesh in the nearest pixel is nearer by more than this."""


class SyntheticView(NamedTuple):
    """A picture made from the surface and the grey values of a source view.

    Attributes:
        raster: its pixels.
        grey: (lines, columns) grey values; NaN, that is empty, where no data support the surface, where it
            turns away or is hidden from one of the two cameras, or lies outside the source's picture.
        hits: intersections of its rays with the surface, N = lines · columns, line by line.
    """

    raster: Raster
    grey: Array
    hits: Hits

    @property
    def filled(self) -> NDArray[np.bool_]:
        """(lines, columns) True for pixels that are not empty."""
        return np.isfinite(self.grey)


def synthetic_view(
    surface: Surface, camera: Camera, raster: Raster, source: Camera, field: Field
) -> SyntheticView:
    """The surface as one camera would see it, painted with the grey values of another.

    Args:
        surface: the outer face at the field's time.
        camera: any camera, the other view or a free one.
        raster: pixels of the view.
        source: the camera that took the grey values.
        field: picture of the source, intact or doubled.
    """
    mesh = Mesh.of(surface)
    hits = cast(surface, mesh, camera, raster)
    grey = np.full(len(hits.u_mm), np.nan)
    met = np.flatnonzero(np.isfinite(hits.u_mm))
    places = source.pixels(hits.xyz_mm[met])
    seen = _shown(hits.xyz_mm[met], hits.normal[met], places, source, field, mesh)
    grey[met[seen]] = grey_at(field, places[seen])
    return SyntheticView(raster, grey.reshape(raster.shape), hits)


def grey_at(field: Field, xy_px: Array) -> Array:
    """(N,) grey values at frame pixels (N, 2), bilinear; NaN outside the field."""
    column, row = xy_px[:, 0], (xy_px[:, 1] - field.y0) / field.y_step
    inside = (column >= 0) & (column <= field.columns - 1) & (row >= 0) & (row <= field.rows - 1)
    left = np.clip(np.floor(np.where(inside, column, 0)), 0, field.columns - 2).astype(np.intp)
    above = np.clip(np.floor(np.where(inside, row, 0)), 0, field.rows - 2).astype(np.intp)
    part_x, part_y = column - left, row - above
    luma = field.luma
    upper = (1 - part_x) * luma[above, left] + part_x * luma[above, left + 1]
    lower = (1 - part_x) * luma[above + 1, left] + part_x * luma[above + 1, left + 1]
    grey: Array = np.where(inside, (1 - part_y) * upper + part_y * lower, np.nan)
    return grey


def _shown(
    xyz_mm: Array, normal: Array, places: Array, source: Camera, field: Field, mesh: Mesh
) -> NDArray[np.bool_]:
    """(N,) True for points that the source's picture shows: in its half, facing it, and not hidden."""
    toward = source.view.center_mm - xyz_mm
    line = (places[:, 1] - field.y0) / field.y_step
    inside = source.view.holds(places) & (line >= 0) & (line <= field.rows - 1)
    facing = np.einsum("na,na->n", normal, toward) > 0
    raster = Raster(source.columns, range(field.y0, field.y0 + field.rows * field.y_step, field.y_step))
    buffer = nearest(mesh, source, raster).distance_mm
    column, row = np.nan_to_num(np.round(raster.places(places))).astype(np.intp).T
    before = buffer[np.clip(row, 0, raster.shape[0] - 1), np.clip(column, 0, raster.shape[1] - 1)]
    hidden = np.linalg.norm(toward, axis=1) > before + _HIDDEN_MM
    shown: NDArray[np.bool_] = inside & facing & ~hidden
    return shown
