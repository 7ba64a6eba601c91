"""A view with its local field, the displacements beyond the functional model, and its rays' hits on a
surface.

The mesh of the surface, drawn into the picture with a depth buffer, gives for every pixel the visible part
of the surface; from there Newton's iteration finds where the pixel's own, undistorted ray meets the smooth
surface. So the intersections are exact (to 1e-5 mm), and only the outline is that of the mesh (.1 px of the
reference rig's liner).
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Calibration, LocalField, View, project, rays, rotation_angles
from grabberd_liner.analysis.surface.surface import Mesh, Surface

_STEPS = 4
"""A local field changes by far less than a tenth of a pixel per pixel: each step gains at least one digit."""
_FILLED = 0.9


class Camera(NamedTuple):
    """Projection into the actual picture, and the rays of its pixels.

    Attributes:
        view: the virtual camera.
        local_field: displacements in its picture beyond the functional model, or None.
    """

    view: View
    local_field: LocalField | None = None

    @classmethod
    def both(cls, calibration: Calibration) -> tuple["Camera", "Camera"]:
        """The left and the right camera of a calibration."""
        left, right = zip(calibration.views, calibration.local_fields, strict=True)
        return cls(*left), cls(*right)

    @property
    def columns(self) -> range:
        """The columns of its half of the picture."""
        return range(self.view.first_column, self.view.end_column)

    def pixels(self, xyz_mm: Array) -> Array:
        """(N, 2) frame pixels of points (N, 3); NaN behind the camera."""
        model_px = project(self.view, xyz_mm)
        if self.local_field is None:
            return model_px
        observed = model_px
        for _ in range(_STEPS):
            observed = model_px + self.local_field.at(np.nan_to_num(observed))
        return observed

    def directions(self, xy_px: Array) -> Array:
        """(N, 3) unit vectors from the projection centre through frame pixels (N, 2)."""
        if self.local_field is not None:
            xy_px = xy_px - self.local_field.at(xy_px)
        return rays(self.view, xy_px)[1]

    @classmethod
    def looking_at(
        cls, like: View, middle_mm: Array, azimuth_deg: float, elevation_deg: float, columns: int, lines: int
    ) -> "Camera":
        """A free camera round a point, without distortion, with the focal length and distance of a view.

        Args:
            like: view that gives focal length, pixel pitch and distance from the point.
            middle_mm: (3,) the point, shown in the middle of the picture.
            azimuth_deg: azimuth of the camera in the xy plane, from x towards y.
            elevation_deg: elevation of the camera above that plane.
            columns: width of the picture.
            lines: height of the picture.
        """
        right, up, toward = viewing_axes(azimuth_deg, elevation_deg)
        away_mm = float(np.linalg.norm(like.center_mm - middle_mm))
        center = middle_mm + away_mm * toward
        omega, phi, kappa = rotation_angles(np.stack([right, up, toward]))
        return cls(
            replace(
                like,
                name="free",
                first_column=0,
                end_column=columns,
                handedness=1,
                pixel_y_mm=like.pixel_x_mm,
                x0_px=(columns - 1) / 2,
                y0_px=(lines - 1) / 2,
                omega_rad=omega,
                phi_rad=phi,
                kappa_rad=kappa,
                X0_mm=float(center[0]),
                Y0_mm=float(center[1]),
                Z0_mm=float(center[2]),
                b=(0.0,) * 9,
            )
        )

    def filling(self, xyz_mm: Array, columns: int, lines: int) -> "Camera":
        """The camera with its pixel pitch and principal point changed so that points fill its picture.

        Args:
            xyz_mm: (N, 3) points to show, all before the camera.
            columns: width of the picture.
            lines: height of the picture.
        """
        pixels = self.pixels(xyz_mm)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        size = np.array([columns, lines])
        larger = float((_FILLED * size / np.maximum(high - low, 1e-6)).min())
        origin = (size - 1) / 2 - larger * ((low + high) / 2 - [self.view.x0_px, self.view.y0_px])
        return Camera(
            replace(
                self.view,
                pixel_x_mm=self.view.pixel_x_mm / larger,
                pixel_y_mm=self.view.pixel_y_mm / larger,
                x0_px=float(origin[0]),
                y0_px=float(origin[1]),
            )
        )


def viewing_axes(azimuth_deg: float, elevation_deg: float) -> tuple[Array, Array, Array]:
    """Unit vectors to the right and up in a picture, and from the object toward the viewer.

    Azimuth is counted in the object's xy plane from x towards y, elevation from that plane towards z, so
    (−90, 90) looks from above with x to the right, (−90, 0) from the side, (0, 0) along x.
    """
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    level = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    toward = math.cos(elevation) * level + math.sin(elevation) * np.array([0.0, 0.0, 1.0])
    return right, np.cross(toward, right), toward


SETTLED_MM = 1e-9
_MOST_STEPS = 12
_AT_ONCE = 4096
"""Rays per batch: bounds memory, since each ray has a jet of 45 numbers."""
_ON_EDGE = 1e-9
"""Slack for pixels on the edge of two triangles, which rounding could put outside both."""


@dataclass(frozen=True, slots=True)
class Raster:
    """The pixels of a picture: some columns of some frame lines."""

    columns: range
    lines: range

    @property
    def shape(self) -> tuple[int, int]:
        """Lines, columns."""
        return len(self.lines), len(self.columns)

    def pixels(self) -> Array:
        """(lines · columns, 2) frame pixels, line by line."""
        x, y = np.meshgrid(np.asarray(self.columns, float), np.asarray(self.lines, float))
        return np.column_stack([x.ravel(), y.ravel()])

    def places(self, xy_px: Array) -> Array:
        """(N, 2) frame pixels as (column, row) in this raster, in its own steps."""
        start = np.array([self.columns.start, self.lines.start], float)
        return (xy_px - start) / [self.columns.step, self.lines.step]


class Seen(NamedTuple):
    """Nearest part of the mesh in each pixel; NaN without any.

    Attributes:
        u_mm: (lines, columns) material coordinate; `v_mm`: likewise.
        distance_mm: (lines, columns) distance from the projection centre.
    """

    u_mm: Array
    v_mm: Array
    distance_mm: Array


class Hits(NamedTuple):
    """Points where rays meet the surface; NaN for rays that meet no part supported by data.

    Attributes:
        u_mm: (N,) material coordinates; `v_mm`: (N,).
        xyz_mm: (N, 3) in the object's frame.
        normal: (N, 3) unit normals, outward.
    """

    u_mm: Array
    v_mm: Array
    xyz_mm: Array
    normal: Array


def cast(surface: Surface, mesh: Mesh, camera: Camera, raster: Raster) -> Hits:
    """Intersections of every pixel's ray with the surface, N = lines · columns, line by line.

    Only the nearest part of the surface counts, and only if its outer face is towards the camera.

    Args:
        surface: the outer face.
        mesh: mesh of the surface.
        camera: camera whose rays are cast.
        raster: pixels whose rays are cast.
    """
    seen = nearest(mesh, camera, raster)
    count = seen.u_mm.size
    # Pixels without a mesh under them stay NaN; the rays of all others are cast in batches.
    hits = Hits(*np.full((2, count), np.nan), *np.full((2, count, 3), np.nan))
    met = np.flatnonzero(np.isfinite(seen.u_mm))
    directions = camera.directions(raster.pixels()[met])
    center, begin = camera.view.center_mm, (seen.u_mm.ravel()[met], seen.v_mm.ravel()[met])
    for first in range(0, len(met), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found = _meet(surface, mesh, center, directions[part], begin[0][part], begin[1][part])
        for whole, piece in zip(hits, found, strict=True):
            whole[met[part]] = piece
    return hits


def nearest(mesh: Mesh, camera: Camera, raster: Raster) -> Seen:
    """The mesh drawn into the picture with a depth buffer."""
    corners, xyz = mesh.corners(), mesh.xyz_mm.reshape(-1, 3)
    triangle = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    place = raster.places(camera.pixels(xyz))
    triangle = triangle[np.isfinite(place[triangle]).all(axis=(1, 2))]
    owner, column, row = _candidates(place[triangle], raster.shape)
    weight = _barycentric(place[triangle[owner]], column, row)
    inside = (weight >= -_ON_EDGE).all(axis=1)
    owner, pixel, weight = owner[inside], (row * raster.shape[1] + column)[inside], weight[inside]
    values = np.column_stack(
        [mesh.u_mm.ravel(), mesh.v_mm.ravel(), np.linalg.norm(xyz - camera.view.center_mm, axis=1)]
    )
    mixed = np.einsum("nk,nkj->nj", weight, values[triangle[owner]])
    order = np.lexsort((mixed[:, 2], pixel))
    pixel, first = np.unique(pixel[order], return_index=True)
    picture = np.full((raster.shape[0] * raster.shape[1], 3), np.nan)
    picture[pixel] = mixed[order[first]]
    return Seen(*picture.T.reshape(3, *raster.shape))


def _candidates(place: Array, shape: tuple[int, int]) -> tuple[Indices, Indices, Indices]:
    """Triangle, column and row of every pixel in the bounding boxes of triangles (K, 3, 2)."""
    limit = np.array([shape[1], shape[0]])
    low = np.clip(np.ceil(place.min(axis=1)), 0, limit).astype(np.intp)
    end = np.clip(np.floor(place.max(axis=1)) + 1, 0, limit).astype(np.intp)
    size = np.maximum(end - low, 0)
    count = size.prod(axis=1)
    owner = np.repeat(np.arange(len(place)), count)
    inner = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    return owner, low[owner, 0] + inner % size[owner, 0], low[owner, 1] + inner // size[owner, 0]


def _barycentric(corner: Array, column: Indices, row: Indices) -> Array:
    """(N, 3) weights of the corners (N, 3, 2) at pixels; a triangle seen edge on contains none."""
    along, across = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    x, y = column - corner[:, 0, 0], row - corner[:, 0, 1]
    area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    area = np.where(area == 0, np.nan, area)
    second = (x * across[:, 1] - y * across[:, 0]) / area
    third = (along[:, 0] * y - along[:, 1] * x) / area
    return np.column_stack([1 - second - third, second, third])


def _meet(surface: Surface, mesh: Mesh, center: Array, directions: Array, u_mm: Array, v_mm: Array) -> Hits:
    """Newton's iteration on the two coordinates across each ray; rays that do not converge miss."""
    across = _across(directions)
    limit = max(surface.domain[2:4]) / 2
    u, v = u_mm.copy(), v_mm.copy()
    for _ in range(_MOST_STEPS):
        jets = mesh.tangents(u, v)
        excess = np.einsum("nka,na->nk", across, jets[:, 0] - center)
        settled: Mask = np.abs(excess).max(axis=1) < SETTLED_MM
        if settled.all():
            break
        slopes = np.einsum("nka,nja->nkj", across, jets[:, 1:3])
        area = slopes[:, 0, 0] * slopes[:, 1, 1] - slopes[:, 0, 1] * slopes[:, 1, 0]
        # A ray within the tangent plane gets no step, so it does not settle and counts as a miss.
        area = np.where(area == 0, np.inf, area)
        step_u = (excess[:, 0] * slopes[:, 1, 1] - excess[:, 1] * slopes[:, 0, 1]) / area
        step_v = (excess[:, 1] * slopes[:, 0, 0] - excess[:, 0] * slopes[:, 1, 0]) / area
        # Near the outline a ray almost grazes the surface and Newton's step explodes: at most half a pitch.
        u -= np.clip(step_u, -limit, limit)
        v -= np.clip(step_v, -limit, limit)
    normal = np.cross(jets[:, 1], jets[:, 2]) * surface.outward
    facing = np.einsum("na,na->n", normal, directions) < 0
    kept = settled & facing & surface.within(u, v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    found = Hits(u, v, jets[:, 0].copy(), normal)
    for values in found:
        values[~kept] = np.nan
    return found


def _across(directions: Array) -> Array:
    """(N, 2, 3) two unit vectors across each direction."""
    helper = np.zeros_like(directions)
    helper[np.arange(len(directions)), np.argmin(np.abs(directions), axis=1)] = 1.0
    first = np.cross(directions, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first)], axis=1)
