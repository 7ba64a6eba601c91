"""The wall's movement as one number per field: the amount of its first principal movement."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

Array = NDArray[np.float64]

# Alternating least squares, from the SVD of the data with gaps as zeros: few rounds, since few are missing.
_ROUNDS = 12
_LEAST_FIELDS = 8
_SEEN_IN = 0.5
_NO_POINTS = "measure the capture first; its fields have to show the object"


class TimedPoints(NamedTuple):
    """The points of one field, with its time in s on any clock that all fields of a capture share."""

    time_s: float
    points: Points


class Movement(NamedTuple):
    """The first principal movement at F fields.

    Attributes:
        time_s: (F,) ascending.
        value_mm: (F,) displacement of the target that moves most from its mean position; towards the cameras
            (+z) is positive, so an open liner has the high values.
        sigma_mm: (F,) σ from the points' covariance.
    """

    time_s: Array
    value_mm: Array
    sigma_mm: Array

    def speed_mm_per_s(self, time_s: Array) -> Array:
        """(N,) speed within the step before or after each time, whichever is greater."""
        step_s = float(np.median(np.diff(self.time_s)))
        moments = (time_s - step_s, time_s, time_s + step_s)
        before, now, after = (np.interp(at_s, self.time_s, self.value_mm) for at_s in moments)
        speed: Array = np.maximum(np.abs(now - before), np.abs(after - now)) / step_s
        return speed


class Tracks(NamedTuple):
    """N targets in F fields; NaN for targets that were not seen.

    Attributes:
        target: (N,) int32, ids, ascending.
        xyz_mm: (F, N, 3); `covariance_mm2`: (F, N, 3, 3), without the calibration's.
        calibration_covariance_mm2: (N, 3, 3) mean over the fields.
    """

    target: NDArray[np.int32]
    xyz_mm: Array
    covariance_mm2: Array
    calibration_covariance_mm2: Array


def tracks(fields: Sequence[TimedPoints]) -> Tracks:
    """The points of all fields, target by target.

    Raises:
        AnalysisError: there are no points.
    """
    ids = np.unique(np.concatenate([field.points.target for field in fields] or [np.empty(0, np.int32)]))
    if not len(ids):
        raise AnalysisError(f"there are no points in {len(fields)} fields", _NO_POINTS)
    xyz = np.full((len(fields), len(ids), 3), np.nan)
    covariance = np.full((len(fields), len(ids), 3, 3), np.nan)
    calibration, seen = np.zeros((len(ids), 3, 3)), np.zeros(len(ids))
    for k, (_, points) in enumerate(fields):
        place = np.searchsorted(ids, points.target)
        xyz[k, place], covariance[k, place] = points.xyz_mm, points.covariance_mm2
        calibration[place] += points.calibration_covariance_mm2
        seen[place] += 1
    return Tracks(ids, xyz, covariance, calibration / seen[:, None, None])


def first_movement(captures: Sequence[Sequence[TimedPoints]]) -> list[Movement]:
    """The first principal movement of the targets, the same direction for all captures.

    Targets may be missing in some fields; those missing in more than half of them are ignored, and so are
    fields that show none of the others.

    Raises:
        AnalysisError: fewer than eight fields have points.
    """
    fields = [field for capture in captures for field in capture]
    if sum(len(field.points) > 0 for field in fields) < _LEAST_FIELDS:
        raise AnalysisError(f"only {len(fields)} fields: too few for a movement", _NO_POINTS)
    moved, covariance = _displacements(tracks(fields))
    direction = _direction(moved)
    value, sigma = _along(moved, covariance, direction)
    times = np.array([field.time_s for field in fields])
    movements, first = [], 0
    for capture in captures:
        of = np.arange(first, first + len(capture))
        of = of[np.isfinite(value[of])]
        movements.append(Movement(times[of], value[of], sigma[of]))
        first += len(capture)
    return movements


def _displacements(all_tracks: Tracks) -> tuple[Array, Array]:
    """(F, N, 3) displacements from the mean and (F, N, 3, 3) their covariance; NaN where not seen."""
    often = np.isfinite(all_tracks.xyz_mm[..., 0]).mean(axis=0) >= _SEEN_IN
    xyz, covariance = all_tracks.xyz_mm[:, often], all_tracks.covariance_mm2[:, often]
    if not often.any():
        raise AnalysisError("no target is seen in half of the fields", _NO_POINTS)
    return xyz - np.nanmean(xyz, axis=0), covariance


def _direction(moved: Array) -> Array:
    """(N, 3) movement of each target per mm of the one that moves most: a rank-one approximation."""
    seen = np.isfinite(moved[..., 0])
    filled = np.where(seen[..., None], moved, 0.0)
    direction = np.linalg.svd(filled.reshape(len(moved), -1), full_matrices=False)[2][0].reshape(-1, 3)
    for _ in range(_ROUNDS):
        amount = _amount(filled, seen, direction)
        share = np.maximum((seen * amount[:, None] ** 2).sum(axis=0), 1e-30)
        direction = np.einsum("f,fnx->nx", amount, filled) / share[:, None]
        direction /= max(float(np.linalg.norm(direction, axis=1).max()), 1e-30)
    # The sign of a singular vector is arbitrary: towards the cameras, so that open is high.
    turned: Array = direction if direction[:, 2].sum() >= 0 else -direction
    return turned


def _amount(filled: Array, seen: NDArray[np.bool_], direction: Array) -> Array:
    share = seen @ (direction**2).sum(axis=1)
    amount: Array = np.einsum("fnx,nx->f", filled, direction) / np.maximum(share, 1e-30)
    return amount


def _along(moved: Array, covariance: Array, direction: Array) -> tuple[Array, Array]:
    """Least squares amount of each field and its σ; NaN if too little of the movement is seen."""
    seen = np.isfinite(moved[..., 0])
    whole = (direction**2).sum()
    share = seen @ (direction**2).sum(axis=1)
    value = _amount(np.where(seen[..., None], moved, 0.0), seen, direction)
    noise = np.where(seen[..., None, None], covariance, 0.0)
    variance = np.einsum("nx,fnxy,ny->f", direction, noise, direction) / np.maximum(share, 1e-30) ** 2
    # The visible targets carry less than a fifth of the movement: their noise would be magnified.
    value[share < 0.2 * whole] = np.nan
    return value, np.sqrt(variance)
