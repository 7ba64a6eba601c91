"""Functional model: from a point of the object to frame pixels (paper eqs. 4–7).

    x = −f·u/w + dx,  y = −f·v/w + dy,  (u, v, w) = R·(X − X0),  column = x0 + x/px,  line = y0 − y/py

x and y are in mm, reduced to the principal point, y up. The camera looks along −z, so points in front have
w < 0; a point in or behind the plane of the projection centre gives NaN.

Where a view's polynomial is a correction, (dx, dy) is added to the observed point and gives the ideal one, so
that the image is iterated. The inverse leads from frame pixels back to the ideal point and its ray; rays of
two views approach one another.

Discs: a view does not see a disc's centre in the middle of the disc's picture, but a point beside it.

The picture of a circle is an ellipse, whose centre is the picture of the pole of the view's vanishing line:
with the disc's normal n, its radius r, its depth d before the camera and the camera's axis z (toward the
camera), all in the object's frame, that point lies in the disc, on its nearer side, at

    r²/d · (z − (z·n) n)  from the centre.

This is exact for a pinhole. Across a disc a lens bends by less than half a thousandth of a pixel, which is
left out (docs/decisions/calibration.md).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry.rig import Rig
from grabberd.core.geometry.view import PARAMETERS, View, basis, monomials

TOLERANCE_MM = 1e-10
"""Length of the last step below which an ideal point counts as found."""
_MOST_STEPS = 30


class _Ideal(NamedTuple):
    """Ideal points `xy_mm` (2, V, N), offsets `away_mm` (V, 3, N) from the centre, `closeness` −1/w (V,
    N).
    """

    xy_mm: Array
    away_mm: Array
    closeness: Array


class Image(NamedTuple):
    """Ideal points mapped to the frame: `pixels` (2, V, N), and their slopes in px/mm.

    `own` (2, V, N) is the derivative of a coordinate by its own ideal coordinate, `other` that by the other.
    """

    pixels: Array
    own: Array
    other: Array

    def pixel_slopes(self, ideal_slopes: Array) -> Array:
        """Convert slopes of the ideal coordinates (2, V, K, N) to slopes of the frame pixels."""
        direct = self.own[:, :, np.newaxis] * ideal_slopes
        direct += self.other[:, :, np.newaxis] * ideal_slopes[::-1]
        return direct


def project(view: View, xyz_mm: Array) -> Array:
    """Project N object points (N, 3) to (N, 2) float64 frame pixels; NaN for points behind the camera."""
    return project_all(single(view), xyz_mm)[:, 0].T


def project_all(rig: Rig, xyz_mm: Array) -> Array:
    """Project N points (N, 3) into every view: (2, V, N) float64 frame pixels (x, y); NaN behind a camera."""
    return image(rig, _ideal(rig, xyz_mm).xy_mm).pixels


def parameter_derivatives(view: View, xyz_mm: Array) -> Array:
    """(N, 2, 18) float64, derivatives of `project` by the view's `PARAMETERS`, in px per their unit."""
    return parameter_slopes(single(view), xyz_mm)[:, 0].transpose(2, 0, 1)


def linearise(rig: Rig, xyz_mm: Array) -> tuple[Array, Array]:
    """Project N points (N, 3), with derivatives by X, Y, Z.

    Returns:
        (2, V, N) frame pixels and (2, V, 3, N) px/mm.
    """
    ideal = _ideal(rig, xyz_mm)
    seen = image(rig, ideal.xy_mm)
    return seen.pixels, seen.pixel_slopes(_object_slopes(rig, ideal))


def parameter_slopes(rig: Rig, xyz_mm: Array) -> Array:
    """(2, V, 18, N) float64, derivatives of the frame pixels by the `PARAMETERS` of their view."""
    return linearise_parameters(rig, xyz_mm)[1]


def linearise_parameters(rig: Rig, xyz_mm: Array) -> tuple[Array, Array]:
    """Project N points (N, 3), with derivatives by the `PARAMETERS` of each view.

    Returns:
        (2, V, N) frame pixels and (2, V, 18, N); the derivatives by the projection centre are those by the
        point itself with the opposite sign.
    """
    ideal = _ideal(rig, xyz_mm)
    seen = image(rig, ideal.xy_mm)
    slopes = np.zeros((2, len(rig.views), len(PARAMETERS), len(xyz_mm)))
    slopes[:, :, :1] = seen.pixel_slopes((ideal.xy_mm / rig.f_mm)[:, :, np.newaxis])
    slopes[0, :, 1] = slopes[1, :, 2] = 1.0
    slopes[:, :, 3:6] = seen.pixel_slopes(_angle_slopes(rig, ideal))
    slopes[:, :, 6:9] = -seen.pixel_slopes(_object_slopes(rig, ideal))
    slopes[:, :, 9:] = _polynomial_slopes(rig, ideal.xy_mm, seen)
    return seen.pixels, slopes


def _polynomial_slopes(rig: Rig, ideal_mm: Array, seen: Image) -> Array:
    """(2, V, 9, N) derivatives of the frame pixels by b1…b9."""
    distorted: Array = basis(ideal_mm) / rig.pixel_mm[:, :, np.newaxis]
    if not rig.corrects.any():
        return distorted
    observed_mm = (seen.pixels - rig.origin_px) * rig.pixel_mm
    corrected = -seen.pixel_slopes(basis(observed_mm))
    return np.where(rig.corrects[:, np.newaxis, np.newaxis], corrected, distorted)


def linearise_corrections(rig: Rig, xyz_mm: Array, observed_px: Array) -> tuple[Array, Array]:
    """Compare ideal points with observed ones after their correction, with derivatives by the `PARAMETERS`.

    Programs that correct observed points compare there and not in the picture, where the errors arise: a
    polynomial that stretches the picture stretches the residuals with it.

    Args:
        rig: Views whose polynomials are corrections.
        xyz_mm: (N, 3) object points.
        observed_px: (2, V, N) frame pixels.

    Returns:
        (2, V, N) ideal minus corrected points in frame pixels, and (2, V, 18, N).
    """
    ideal = _ideal(rig, xyz_mm)
    straight = rig.pixel_mm[:, :, np.newaxis]
    observed_mm = (observed_px - rig.origin_px) * rig.pixel_mm
    corrected = _polynomials(rig, observed_mm)
    slopes = np.zeros((2, len(rig.views), len(PARAMETERS), len(xyz_mm)))
    slopes[:, :, 0] = ideal.xy_mm / rig.f_mm / rig.pixel_mm
    slopes[0, :, 1], slopes[1, :, 2] = corrected.own * rig.pixel_mm
    slopes[0, :, 2], slopes[1, :, 1] = corrected.other * rig.pixel_mm[::-1]
    slopes[:, :, 3:6] = _angle_slopes(rig, ideal) / straight
    slopes[:, :, 6:9] = -_object_slopes(rig, ideal) / straight
    slopes[:, :, 9:] = -basis(observed_mm) / straight
    return rig.origin_px + ideal.xy_mm / rig.pixel_mm - corrected.pixels, slopes


def image(rig: Rig, ideal_mm: Array) -> Image:
    """Map ideal points (2, V, N) to frame pixels, with slopes; NaN where a correction leads from nowhere."""
    distorted = _polynomials(rig, ideal_mm)
    if not rig.corrects.any():
        return distorted
    observed_mm = _solved(rig, rig.origin_px + ideal_mm / rig.pixel_mm)
    there = _polynomials(rig, observed_mm)
    area = _area(there) * rig.pixel_mm
    corrected = Image(
        rig.origin_px + observed_mm / rig.pixel_mm,
        there.own[::-1] / (area * rig.pixel_mm),
        -there.other / (area * rig.pixel_mm[::-1]),
    )
    return Image(*(_by_view(rig, *both) for both in zip(corrected, distorted, strict=True)))


def _polynomials(rig: Rig, xy_mm: Array) -> Image:
    """Add equations (6) and (7) to points (2, V, N), with slopes; in frame pixels."""
    values = (rig.image @ monomials(xy_mm)).reshape(len(rig.views), 4, 2, -1)
    own, other, own_slope, other_slope = values.transpose(1, 2, 0, 3)
    pixels = xy_mm * own
    pixels += xy_mm[::-1] * other
    pixels += rig.origin_px
    return Image(pixels, own_slope, other_slope)


def _area(seen: Image) -> Array:
    """(V, N) determinant of the slopes, whose sign changes at the fold of the polynomials."""
    return seen.own[0] * seen.own[1] - seen.other[0] * seen.other[1]


def _by_view(rig: Rig, corrected: Array, distorted: Array) -> Array:
    """Select by the meaning of each view's polynomial; both are (…, V, N)."""
    return np.where(rig.corrects[:, np.newaxis], corrected, distorted)


@lru_cache(maxsize=64)
def single(view: View) -> Rig:
    """Make a rig of one view."""
    return Rig.of_views([view])


def _ideal(rig: Rig, xyz_mm: Array) -> _Ideal:
    away = xyz_mm.T - rig.center_mm
    camera = rig.rotation @ away
    depth = camera[:, 2]
    closeness = -1.0 / np.where(depth < 0.0, depth, np.nan)
    return _Ideal(camera[:, :2].swapaxes(0, 1) * (rig.f_mm * closeness), away, closeness)


def _object_slopes(rig: Rig, ideal: _Ideal) -> Array:
    """(2, V, 3, N) derivatives of the ideal coordinates by X, Y, Z."""
    return _perspective_slopes(rig, ideal, rig.rotation[..., np.newaxis])


def _angle_slopes(rig: Rig, ideal: _Ideal) -> Array:
    """(2, V, 3, N) derivatives of the ideal coordinates by ω, φ, κ."""
    turned = rig.rotation_rates @ ideal.away_mm
    return _perspective_slopes(rig, ideal, turned.transpose(1, 2, 0, 3))


def _perspective_slopes(rig: Rig, ideal: _Ideal, camera_slopes: Array) -> Array:
    """Apply the quotient rule of the perspective to the slopes (V, 3, K, N) of the camera coordinates."""
    sideways = camera_slopes[:, :2].swapaxes(0, 1) * rig.f_mm[:, :, np.newaxis]
    inward = ideal.xy_mm[:, :, np.newaxis] * camera_slopes[:, 2]
    return (sideways + inward) * ideal.closeness[:, np.newaxis]


def rays(view: View, xy_px: Array) -> tuple[Array, Array]:
    """Compute the rays on which observed points lie.

    Returns:
        The projection centre (3,) in mm and unit vectors (N, 3) from it toward the object, both in the
        object's frame; NaN where `correct_all` gives NaN.
    """
    directions = directions_all(single(view), correct_all(single(view), xy_px.T[:, np.newaxis]))
    return view.center_mm, directions[0].T


def correct_all(rig: Rig, xy_px: Array) -> Array:
    """Compute ideal points from observed ones: distortion removed, reduced to the principal point.

    Newton's iteration until its step is below `TOLERANCE_MM`, never a single step; where the polynomial is a
    correction, none is needed.

    Args:
        rig: Views that they were observed in.
        xy_px: (2, V, N) float64, frame pixels.

    Returns:
        (2, V, N) float64, mm, y up. NaN where the iteration does not converge, or leads beyond the fold of
        the polynomial, where no object point can be seen; NaN in gives NaN out.
    """
    if not rig.corrects.any():
        return _solved(rig, xy_px)
    with np.errstate(over="ignore", invalid="ignore"):
        there = _polynomials(rig, (xy_px - rig.origin_px) * rig.pixel_mm)
        corrected = (there.pixels - rig.origin_px) * rig.pixel_mm
        corrected[:, ~_unfolded(rig, _area(there))] = np.nan
    return _by_view(rig, corrected, _solved(rig, xy_px))


def _solved(rig: Rig, xy_px: Array) -> Array:
    """(2, V, N) points in mm from which the polynomials lead to frame pixels; NaN where there is none."""
    point = (xy_px - rig.origin_px) * rig.pixel_mm
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(_MOST_STEPS):
            step, area = _newton_step(rig, point, xy_px)
            point -= step
            unsettled = ~(np.abs(step).max(axis=0) < TOLERANCE_MM)
            if not (unsettled & np.isfinite(area)).any():
                break
        point[:, unsettled | ~_unfolded(rig, area)] = np.nan
    return point


def _unfolded(rig: Rig, area: Array) -> Mask:
    """(V, N) True where the polynomials' determinant has the sign that it has in the middle."""
    # Pixels count down where y points up: not folded, the determinant has the sign of both pitches together.
    return area * np.sign(rig.pixel_mm[0] * rig.pixel_mm[1]) > 0.0


def directions_all(rig: Rig, ideal_mm: Array) -> Array:
    """(V, 3, N) unit vectors in the object's frame, from the cameras through the ideal points (2, V, N)."""
    _, views, count = ideal_mm.shape
    camera = np.empty((views, 3, count))
    camera[:, :2] = ideal_mm.swapaxes(0, 1)
    camera[:, 2] = -rig.f_mm
    camera /= np.sqrt((camera * camera).sum(axis=1, keepdims=True))
    return rig.rotation.swapaxes(1, 2) @ camera


def _newton_step(rig: Rig, point: Array, goal_px: Array) -> tuple[Array, Array]:
    """The step (2, V, N) in mm, and the slopes' determinant (V, N)."""
    seen = _polynomials(rig, point)
    excess = seen.pixels - goal_px
    area = _area(seen)
    return (excess * seen.own[::-1] - seen.other * excess[::-1]) / area, area


class Approach(NamedTuple):
    """Closest approach of pairs of rays.

    Attributes:
        distance_mm: (…) shortest distance, signed: positive if the right ray passes on the side of left
            direction × right direction.
        middle_mm: (…, 3) middle of the shortest connection.
    """

    distance_mm: Array
    middle_mm: Array


def approach(left_center: Array, left: Array, right_center: Array, right: Array) -> Approach:
    """Compute the closest approach of rays; (N, 1, 3) directions against (1, M, 3) compare every pair.

    Args:
        left_center: (3,) mm, object's frame.
        left: (…, 3) unit vectors from it.
        right_center: (3,) mm.
        right: (…, 3) unit vectors from it.

    Returns:
        Distances and middles; NaN for parallel rays. Two rays of the same object point pass at distance 0:
        the epipolar condition in mm.
    """
    base = right_center - left_center
    cosine = _dot(left, right)
    along_left, along_right = _dot(left, base), _dot(right, base)
    slenderness = 1.0 - cosine * cosine
    # Rays less than 1e-6 rad apart: their closest approach is rounding alone.
    slenderness = np.where(slenderness > 1e-12, slenderness, np.nan)
    reach_left = (along_left - cosine * along_right) / slenderness
    reach_right = (cosine * along_left - along_right) / slenderness
    on_left = reach_left[..., np.newaxis] * left
    on_right = reach_right[..., np.newaxis] * right
    middle = left_center + 0.5 * (on_left + on_right + base)
    return Approach(_dot(np.cross(left, right), base) / np.sqrt(slenderness), middle)


def _dot(first: Array, second: Array) -> Array:
    return (first * second).sum(axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Discs:
    """N discs of one size.

    Attributes:
        normal: (N, 3) unit vectors, in the object's frame, of either sign.
        diameter_mm: Their diameter.
    """

    normal: Array
    diameter_mm: float

    @classmethod
    def parallel(cls, count: int, diameter_mm: float, normal: tuple[float, float, float]) -> "Discs":
        """Make discs that all lie the same way, such as those of a calibration frame."""
        unit = np.array(normal) / np.linalg.norm(normal)
        return cls(np.broadcast_to(unit, (count, 3)), diameter_mm)

    def select(self, chosen: Indices) -> "Discs":
        """Select some of them."""
        return Discs(self.normal[chosen], self.diameter_mm)

    def shifts_mm(self, rig: Rig, xyz_mm: Array) -> Array:
        """(V, 3, N) from centres (N, 3) to the points that each view shows in the middle of the pictures."""
        axis = rig.rotation[:, 2, :, np.newaxis]
        depth = -(axis * (xyz_mm.T - rig.center_mm)).sum(axis=1, keepdims=True)
        normal = self.normal.T
        along = axis - (axis * normal).sum(axis=1, keepdims=True) * normal
        shift: Array = (0.25 * self.diameter_mm**2 / depth) * along
        return shift

    def offsets_px(self, rig: Rig, xyz_mm: Array, slopes: Array) -> Array:
        """(2, V, N) of the middles of pictures from the pictures of the centres, in frame pixels.

        Args:
            rig: The views.
            xyz_mm: (N, 3) centres.
            slopes: (2, V, 3, N) derivatives of the frame pixels by X, Y, Z there.
        """
        offset: Array = (slopes * self.shifts_mm(rig, xyz_mm)).sum(axis=2)
        return offset
