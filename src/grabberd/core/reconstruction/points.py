"""Points: positions of targets in space, of one field or of many as a series; and why a target has none.

A point is the intersection of a target's two blobs: least squares on the full functional model (paper 3.7),
with the covariance of the four image coordinates, from pointing and the shared line jitter.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig, approach, correct_all, directions_all, linearise, parameter_slopes
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.errors import MeasurementError

_JITTER_OF_A_BLOB = 0.735
"""σ of a centroid's x per σ of its lines' shifts, times √(line pitch / radius): chords weigh by length."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewBlobs:
    """N blobs of one view.

    Attributes:
        xy_px: (N, 2) float64, frame pixels.
        sigma_px: (N, 2) float64, above 0: standard deviation of `xy_px` from location alone, without line
            jitter.
        common_px: (N,) float64, standard deviation of the error in x shared by blobs on the same lines in
            both views; None takes it from the line jitter of `ImageNoise`.
        common_reach_px: Distance in frame lines over which its correlation falls to e^−½.

    Raises:
        MeasurementError: A position or standard deviation is not finite, or a standard deviation is not above
            0.
    """

    xy_px: Array
    sigma_px: Array
    common_px: Array | None = None
    common_reach_px: float = 0.0

    def __post_init__(self) -> None:
        # The minimum, and the sum of squares, are NaN if any value is.
        least_px = np.minimum.reduce(self.sigma_px, axis=None, initial=np.inf)
        if not (least_px > 0.0 and math.isfinite(np.vdot(self.xy_px, self.xy_px))):
            raise MeasurementError(
                f"some of {len(self)} blobs have no position, or no standard deviation above 0",
                "this is a bug in the location method: choose another, and report it",
            )

    def __len__(self) -> int:
        return len(self.xy_px)

    def select(self, chosen: Mask | Indices) -> "ViewBlobs":
        """Select blobs by a mask or index array."""
        common_px = None if self.common_px is None else self.common_px[chosen]
        return ViewBlobs(self.xy_px[chosen], self.sigma_px[chosen], common_px, self.common_reach_px)


@dataclass(frozen=True, slots=True)
class ImageNoise:
    """Errors of image coordinates other than pointing.

    Attributes:
        jitter_px: Standard deviation of a line's shift, common to the whole line and so to both views.
        y_step: Frame lines from row to row: 2 intact, 1 doubled.
        radius_lines: Radius of a target's image in frame lines.
    """

    jitter_px: float
    y_step: int
    radius_lines: float

    @classmethod
    def of(
        cls, rig: Rig, model: ObjectModel, jitter_px: float, y_step: int, lines_apart: int = 2
    ) -> "ImageNoise":
        """Noise of an object seen by a rig, with the radius at the middle of the object, seen face on.

        Lines of progressive pictures, which are one frame line apart, do not shift.
        """
        jitter_px = 0.0 if lines_apart == 1 else jitter_px
        _, slopes = linearise(rig, model.xyz_mm.mean(axis=0, keepdims=True))
        lines_per_mm = float(np.sqrt((slopes[1] ** 2).sum(axis=1)).mean())
        return cls(jitter_px, y_step, 0.5 * model.target_diameter_mm * lines_per_mm)

    @property
    def blob_jitter_px(self) -> float:
        """Standard deviation of a blob's x from line jitter alone."""
        return _JITTER_OF_A_BLOB * self.jitter_px * math.sqrt(self.y_step / self.radius_lines)

    def expected(self, lines: Array) -> "Common":
        """Error shared by blobs on frame lines (2, N) if the shifts have not been solved for."""
        overlap = np.maximum(1.0 - np.abs(lines[0] - lines[1]) / (2.0 * self.radius_lines), 0.0)
        return Common(np.full_like(lines, self.blob_jitter_px), overlap)

    def whitening(self, lines: Array, sigma_px: Array, common: "Common | None" = None) -> "Whitening":
        """Make the transformation to four uncorrelated coordinates of unit weight.

        Args:
            lines: (2, N) y of the blobs in frame lines: left, right.
            sigma_px: (2, 2, N) pointing σ of x and y (first axis) in the left and right view (second).
            common: Error of line jitter in x, if known better than by `expected`.
        """
        sigma, overlap = common or self.expected(lines)
        # Cholesky by hand: only the two x correlate, so the factor has a single element off its diagonal.
        scale = np.empty_like(sigma_px)
        np.divide(1.0, sigma_px[1], out=scale[1])
        variance = sigma_px[0] * sigma_px[0] + sigma * sigma
        # Both x share the shifts of their lines: taken as independent, σ of Z comes out half too large.
        shared = sigma[0] * sigma[1] * overlap
        np.divide(1.0, np.sqrt(variance[0]), out=scale[0, 0])
        mixed = shared * scale[0, 0]
        np.divide(1.0, np.sqrt(variance[1] - mixed * mixed), out=scale[0, 1])
        return Whitening(scale, mixed * scale[0, 1])


class Common(NamedTuple):
    """Error in x shared by both blobs of a target, since they lie on the same lines.

    Attributes:
        sigma_px: (2, N) its standard deviation in the left and right view.
        overlap: (N,) correlation of the two.
    """

    sigma_px: Array
    overlap: Array

    @classmethod
    def of(cls, sigma_px: Array, lines: Array, reach_px: float) -> "Common":
        """Make it for blobs on frame lines (2, N), with a correlation that falls to e^−½ over the reach."""
        return cls(sigma_px, np.exp(-0.5 * ((lines[0] - lines[1]) / reach_px) ** 2))


class Whitening(NamedTuple):
    """Inverse Cholesky factors of N covariances in which only the left and the right x correlate.

    Attributes:
        scale: (2, 2, N): coordinate, view.
        mixed: (N,) share of the left view's whitened x subtracted from the right view's.
    """

    scale: Array
    mixed: Array

    def of_values(self, values: Array) -> Array:
        """Whiten values (2, 2, N)."""
        white = values * self.scale
        white[0, 1] -= self.mixed * white[0, 0]
        return white

    def of_slopes(self, slopes: Array) -> Array:
        """Whiten derivatives of values (2, 2, K, N)."""
        white = slopes * self.scale[:, :, np.newaxis]
        white[0, 1] -= self.mixed * white[0, 0]
        return white


@dataclass(frozen=True, slots=True, eq=False)
class SingleViewImages:
    """Images of N targets that one view alone sees in a field, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        view: (N,) the view that sees each, 0 left, 1 right.
        image_px: (N, 2) float64, frame pixels x and y, corrected by the view's local field if it has one.
        sigma_px: (N, 2) float64, their standard deviation, line jitter included.
    """

    target: NDArray[np.int32]
    view: Indices
    image_px: Array
    sigma_px: Array

    def __len__(self) -> int:
        return len(self.target)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """N points of one field, in the object's frame, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        xyz_mm: (N, 3) float64.
        covariance_mm2: (N, 3, 3) float64, from pointing and line jitter: independent from field to field.
        calibration_covariance_mm2: (N, 3, 3) float64, from the calibration: common to all fields and not
            reduced by averaging, hence kept separate.
        image_px: (N, 2, 2) float64, frame pixels of the blobs it was intersected from: [point, view, (x, y)],
            view 0 left, 1 right; corrected by the views' local fields if the calibration has them.
        residual_px: (N,) float64, root mean square of the four image residuals after intersection.
        single: images of further targets, which one view alone sees; None if they have not been sought.
    """

    target: NDArray[np.int32]
    xyz_mm: Array
    covariance_mm2: Array
    calibration_covariance_mm2: Array
    image_px: Array
    residual_px: Array
    single: SingleViewImages | None = None

    @classmethod
    def joined(cls, parts: Sequence["Points"]) -> "Points":
        """Join the points of some fields, in order and without their single views."""
        columns: Any = (np.concatenate([getattr(one, name) for one in parts]) for name in _COLUMNS)
        return cls(*columns)

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: Mask | Indices) -> "Points":
        """Select points by a mask or ascending index array."""
        columns: Any = [getattr(self, name)[chosen] for name in _COLUMNS]
        return Points(*[*columns, self.single])

    @classmethod
    def none(cls) -> "Points":
        """Make an empty set of points."""
        return cls(
            np.empty(0, np.int32),
            np.empty((0, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 2, 2)),
            np.empty(0),
        )


_COLUMNS = ("target", "xyz_mm", "covariance_mm2", "calibration_covariance_mm2", "image_px", "residual_px")


@dataclass(frozen=True, slots=True, eq=False)
class PointSeries:
    """Points of F fields and T targets; NaN where a target has no point in a field.

    Attributes:
        n: (F,) int64, field numbers, ascending, including fields without any point.
        time_s: (F,) time since the first field.
        target: (T,) int32, ids, ascending, of all targets with a point in any field.
        xyz_mm: (F, T, 3), in the object's frame.
        covariance_mm2: (F, T, 3, 3), see `Points`.
        calibration_covariance_mm2: (F, T, 3, 3), see `Points`.
        image_px: (F, T, 2, 2), [field, target, view, (x, y)].
    """

    n: NDArray[np.int64]
    time_s: Array
    target: NDArray[np.int32]
    xyz_mm: Array
    covariance_mm2: Array
    calibration_covariance_mm2: Array
    image_px: Array

    @classmethod
    def of(cls, measured: Iterable[tuple[int, int, Points]]) -> "PointSeries":
        """Collect from field numbers, times in ns, and points, in order."""
        rows = list(measured)
        points = [of_field for _, _, of_field in rows]
        target = np.unique(np.concatenate([np.empty(0, np.int32), *(one.target for one in points)]))
        columns = [np.searchsorted(target, one.target) for one in points]

        def spread(name: str, *shape: int) -> Array:
            series = np.full((len(points), len(target), *shape), np.nan)
            for of_field, column, one in zip(series, columns, points, strict=True):
                of_field[column] = getattr(one, name)
            return series

        times_ns = np.array([time_ns for _, time_ns, _ in rows], np.int64)
        return cls(
            n=np.array([n for n, _, _ in rows], np.int64),
            time_s=(times_ns - times_ns[:1]) / 1e9,
            target=target,
            xyz_mm=spread("xyz_mm", 3),
            covariance_mm2=spread("covariance_mm2", 3, 3),
            calibration_covariance_mm2=spread("calibration_covariance_mm2", 3, 3),
            image_px=spread("image_px", 2, 2),
        )

    @property
    def seen(self) -> Mask:
        """(F, T) True where a target has a point in a field."""
        return np.isfinite(self.xyz_mm[:, :, 0])

    @property
    def parity(self) -> Indices:
        """(F,) 0 or 1: fields of equal parity show the same lines, unless they are progressive pictures."""
        return (self.n & 1).astype(np.intp)

    def without(self, gone: Mask) -> "PointSeries":
        """Remove some points (F, T)."""
        kept = np.where(gone, np.nan, 1.0)[:, :, np.newaxis]
        return replace(self, xyz_mm=self.xyz_mm * kept)


class Miss(IntEnum):
    """Outcome of the search for one target in one field.

    The first ones are also those of the compiled kernel (space.h): one bit for each view without a blob.
    """

    FOUND = 0
    NO_BLOB_LEFT = 1
    """No blob near its predicted image in the left view."""
    NO_BLOB_RIGHT = 2
    NO_BLOB = 3
    """None in either view."""
    RAYS_APART = 4
    """There is a blob in both views, but their rays do not meet."""
    OFF_PLACE = 5
    """The rays meet too far from where its neighbours put it."""
    UNCONFIRMED = 6
    """Found, but only once after a long time and hence not reported: it may have been a false blob."""
    NOT_IDENTIFIED = 7
    """No target was identified in the whole field."""
    CUT_OFF = 8
    """Its predicted image is cut off by the edge of its view."""
    UNPREDICTED = 9
    """Its neighbours are too far away to predict it."""
    TAKEN = 10
    """The blob near its predicted image serves a neighbour, which is nearer."""
    CROWDED = 11
    """Found, but not reported: a neighbour too faint for a blob of its own shines into its narrow image."""
    TURNED_AWAY = 12
    """It faces away from a view, which cannot show it: it was not looked for, as with the two below."""
    HIDDEN = 13
    """In a view the wall is before it."""
    MERGED = 14
    """In a view its image is too near to a neighbour's to be a blob of its own."""
    OUTSIDE = 15
    """Its predicted image lies outside of a view."""

    @property
    def key(self) -> str:
        """Its name in documents."""
        return self.name.lower()


_SETTLED_MM = 5e-3
"""Last step of the iteration: the next would be below 1e-6 mm, so nearly linear is the model at .2 m."""
_MOST_STEPS = 10

FIRST, SECOND = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
"""Row and column of each of the six elements."""
DIAGONAL = (0, 3, 5)
"""Indices of the diagonal elements among the six."""
_SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_COFACTORS = np.array([(3, 2, 1, 0, 1, 0), (5, 4, 4, 5, 2, 3), (4, 1, 2, 2, 0, 1), (4, 5, 3, 2, 4, 1)])


class _Adjusted(NamedTuple):
    """xyz (3, N); inverse normal matrix (3, 3, N); whitened slopes (4, 3, N); residuals in px (2, 2, N)."""

    xyz: Array
    inverse: Array
    slopes: Array
    residual: Array


def intersect(
    rig: Rig,
    target: NDArray[np.int32],
    left: ViewBlobs,
    right: ViewBlobs,
    noise: ImageNoise,
    start_mm: Array | None = None,
) -> Points:
    """Intersect N targets from their blobs in the left and right view.

    Weighted least squares of the four image coordinates on equations (4)–(7), all points at once. The
    covariance is that of pointing and line jitter; the calibration's share is J·C·Jᵀ with J from implicit
    differentiation of the least-squares condition, zero if the rig's covariance is unknown.

    Args:
        rig: Left and right view.
        target: (N,) int32, ids, ascending.
        left: N blobs of the left view, in the order of `target`.
        right: N blobs of the right view.
        noise: Line jitter, for blobs that do not carry their shared error.
        start_mm: (N, 3) start values, good to some millimetres; without them, the middles of the rays'
            shortest connections.

    Returns:
        The points; NaN for a pair of blobs whose rays do not meet in front of the cameras.
    """
    if not len(target):
        return Points.none()
    observed = _stack(left.xy_px, right.xy_px)
    start = middles(rig, observed) if start_mm is None else start_mm
    common = _common(left, right, observed[1])
    whitening = noise.whitening(observed[1], _stack(left.sigma_px, right.sigma_px), common)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        adjusted = _adjust(rig, observed, whitening, start)
        share = _calibration_share(rig, observed, whitening, adjusted)
    return Points(
        target=target,
        xyz_mm=adjusted.xyz.T.copy(),
        covariance_mm2=adjusted.inverse.transpose(2, 0, 1).copy(),
        calibration_covariance_mm2=share,
        image_px=observed.transpose(2, 1, 0).copy(),
        residual_px=np.sqrt((adjusted.residual * adjusted.residual).reshape(4, -1).mean(axis=0)),
    )


def middles(rig: Rig, observed_px: Array) -> Array:
    """(N, 3) middles of the shortest connections of N pairs of rays, from observed (2, 2, N) coordinate,
    view.
    """
    left, right = directions_all(rig, correct_all(rig, observed_px)).swapaxes(1, 2)
    centers = rig.center_mm[:, :, 0]
    return approach(centers[0], left, centers[1], right).middle_mm


def _common(left: ViewBlobs, right: ViewBlobs, lines: Array) -> Common | None:
    """Line-jitter error shared by N pairs, if their blobs carry it."""
    if left.common_px is None or right.common_px is None:
        return None
    return Common.of(np.array([left.common_px, right.common_px]), lines, left.common_reach_px)


def _adjust(rig: Rig, observed: Array, whitening: Whitening, start_mm: Array) -> _Adjusted:
    xyz = start_mm.T
    for _ in range(_MOST_STEPS):
        computed, slopes = linearise(rig, xyz.T)
        residual = observed - computed
        design = whitening.of_slopes(slopes).reshape(4, 3, -1)
        misfit = whitening.of_values(residual).reshape(4, 1, -1)
        # By cofactors: a few operations on all points at once, where LAPACK takes matrices one by one.
        inverse = inverse_symmetric((design[:, FIRST] * design[:, SECOND]).sum(axis=0))
        step = (inverse * (design * misfit).sum(axis=0)).sum(axis=1)
        xyz = xyz + step
        # Put this way round NaN, rays that do not meet, counts as settled and does not hold up the others.
        if not (np.abs(step) > _SETTLED_MM).any():
            break
    return _Adjusted(xyz, inverse, design, residual - (slopes * step).sum(axis=2))


def _calibration_share(rig: Rig, observed: Array, whitening: Whitening, adjusted: _Adjusted) -> Array:
    """(N, 3, 3) J·C·Jᵀ.

    The solution X(l, p) satisfies Aᵀ(l − f(X, p)) = 0 (whitened), so dX/dp = −(AᵀA)⁻¹Aᵀ·∂f/∂p; with C = L·Lᵀ
    the share is G·Gᵀ, G = (AᵀA)⁻¹Aᵀ·(∂f/∂p·L). The local fields' errors move l itself.
    """
    count = adjusted.xyz.shape[1]
    errors = _calibration_errors(rig, observed, adjusted.xyz)
    if not errors:
        return np.zeros((count, 3, 3))
    moved = errors[0] if len(errors) == 1 else np.concatenate(errors, axis=2)
    image = whitening.of_slopes(moved).reshape(4, -1, count).transpose(2, 0, 1)
    root = adjusted.inverse.transpose(2, 0, 1) @ (adjusted.slopes.transpose(2, 1, 0) @ image)
    return root @ root.swapaxes(1, 2)


def _calibration_errors(rig: Rig, observed: Array, xyz: Array) -> list[Array]:
    """(2, 2, K, N) shifts of image coordinates by K independent calibration errors of 1 σ each."""
    errors = []
    if rig.factor is not None:
        errors.append(rig.factor.swapaxes(1, 2) @ parameter_slopes(rig, xyz.T))
    if (local := rig.local_errors_px(observed)) is not None:
        errors.append(local)
    return errors


def _stack(left: Array, right: Array) -> Array:
    """Stack (N, 2) of either view to (2, 2, N): coordinate, view, point."""
    return np.array([left.T, right.T]).swapaxes(0, 1)


def inverse_symmetric(six: Array) -> Array:
    """Invert N symmetric matrices given by their six elements (6, N), as (3, 3, N); rank is not checked."""
    first, second, third, fourth = six[_COFACTORS]
    cofactors = first * second - third * fourth
    determinant = (six[:3] * cofactors[:3]).sum(axis=0)
    return (cofactors / determinant)[_SQUARE]
