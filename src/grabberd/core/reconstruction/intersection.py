"""Intersection of a target's two blobs to a point: least squares on the full functional model (paper 3.7)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig, approach, correct_all, directions_all, linearise, parameter_slopes
from grabberd.core.reconstruction.points import Points
from grabberd.core.reconstruction.view_blobs import Common, ImageNoise, ViewBlobs, Whitening

Array = NDArray[np.float64]

_SETTLED_MM = 5e-3
"""Last step of the iteration: the next would be below 1e-6 mm, so nearly linear is the model at .2 m."""
_MOST_STEPS = 10

_EACH = np.eye(4).reshape(2, 2, 4, 1)
"""Coordinate, view, error: each error moves one image coordinate."""
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
    if (sigma := rig.local_sigma_px(observed)) is not None:
        errors.append(_EACH * sigma[:, :, np.newaxis])
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
