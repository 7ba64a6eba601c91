"""The wall's movement as one number per field: the amount of its first principal movement.

A quantity that repeats with the cycle: a Fourier series of the phase, with covariance.

    w(φ) = c0 + Σk ck cos 2πkφ + sk sin 2πkφ,  k = 1 … K;   coefficients c0, c1 … cK, s1 … sK

A priori its harmonics fall off as 1/k², as for any movement without jumps; up to a corner only as 1/k, as for
one whose flanks are so steep that they look like jumps.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError

# Phases at which extremes and crossings are looked for: a quarter of a millisecond in a cycle of a second.
_FINE = 4096
_PLATEAU = 0.01


def basis(phase: Array, count: int) -> Array:
    """(..., 2 count + 1) terms of the series at phases (...,) in cycles."""
    angle = 2 * np.pi * phase[..., None] * np.arange(1, count + 1)
    return np.concatenate([np.ones_like(phase)[..., None], np.cos(angle), np.sin(angle)], axis=-1)


def basis_slope(phase: Array, count: int) -> Array:
    """(..., 2 count + 1) their derivatives by the phase, per cycle."""
    waves = 2 * np.pi * np.arange(1, count + 1)
    angle = phase[..., None] * waves
    zero = np.zeros_like(phase)[..., None]
    return np.concatenate([zero, -waves * np.sin(angle), waves * np.cos(angle)], axis=-1)


def prior_precision(count: int, variance: float, corner: float = 0.0) -> Array:
    """(2 count + 1,) prior precision of the coefficients of a series of this variance; the mean is free."""
    waves = np.arange(1, count + 1, dtype=np.float64)
    falling = 1.0 / (waves**2 * (waves**2 + corner**2))
    each = variance / falling.sum() * falling
    return 1 / np.concatenate([[1e4 * variance], each, each])


def rotated(coefficients: Array, phase: float) -> Array:
    """(2K + 1, …) coefficients of w(φ + phase); only rows are mixed, so a covariance is rotated twice."""
    count = (len(coefficients) - 1) // 2
    angle = 2 * np.pi * phase * np.arange(1, count + 1)
    shape = (count,) + (1,) * (coefficients.ndim - 1)
    cosine, sine = np.cos(angle).reshape(shape), np.sin(angle).reshape(shape)
    even, odd = coefficients[1 : count + 1], coefficients[count + 1 :]
    return np.concatenate([coefficients[:1], even * cosine + odd * sine, odd * cosine - even * sine])


class Waveform(NamedTuple):
    """A periodic quantity.

    Attributes:
        coefficients: (2K + 1,) as above; `covariance`: (2K + 1, 2K + 1).
    """

    coefficients: Array
    covariance: Array

    @property
    def harmonics(self) -> int:
        """Number K of harmonics."""
        return (len(self.coefficients) - 1) // 2

    def value(self, phase: Array) -> Array:
        """(...,) at phases (...,) in cycles."""
        return basis(phase, self.harmonics) @ self.coefficients

    def slope(self, phase: Array) -> Array:
        """(...,) its derivative, per cycle."""
        return basis_slope(phase, self.harmonics) @ self.coefficients

    def sigma(self, phase: Array) -> Array:
        """(...,) σ of its value."""
        terms = basis(phase, self.harmonics)
        variance: Array = np.einsum("...i,ij,...j->...", terms, self.covariance, terms)
        return np.sqrt(np.maximum(variance, 0.0))

    def extremes(self) -> tuple[float, float]:
        """Phases of the least and of the greatest value."""
        phase = np.arange(_FINE) / _FINE
        values = self.value(phase)
        return float(phase[values.argmin()]), float(phase[values.argmax()])

    def level_terms(self) -> Array:
        """(2, 2K + 1) terms whose products with the coefficients are the lowest and the highest level.

        Each is the mean of the values within 1 % of the stroke of the extreme: for a plateau its level rather
        than the peak of its noise.
        """
        phase = np.arange(_FINE) / _FINE
        terms = basis(phase, self.harmonics)
        values = terms @ self.coefficients
        room = _PLATEAU * np.ptp(values)
        low, high = values <= values.min() + room, values >= values.max() - room
        return np.stack([terms[low].mean(axis=0), terms[high].mean(axis=0)])

    def levels(self) -> tuple[float, float]:
        """The lowest and the highest level."""
        low, high = self.level_terms() @ self.coefficients
        return float(low), float(high)

    def crossings(self, level: float) -> tuple[Array, Array]:
        """Phases at which the quantity rises and falls through a level, each ascending in [0, 1)."""
        phase = np.arange(_FINE + 1) / _FINE
        above = self.value(phase) - level
        at = np.flatnonzero((above[:-1] < 0) != (above[1:] < 0))
        exact = phase[at] + above[at] / (above[at] - above[at + 1]) / _FINE
        rising = above[at] < 0
        return np.mod(exact[rising], 1.0), np.mod(exact[~rising], 1.0)

    def turned(self, phase: float) -> "Waveform":
        """The same quantity with its phase counted from `phase`."""
        covariance = rotated(rotated(self.covariance, phase).T, phase).T
        return Waveform(rotated(self.coefficients, phase), covariance)


# Alternating least squares, from the SVD of the data with gaps as zeros.
_ROUNDS = 20
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
        size_sigma: relative σ that all values share: how well the movement of that target is known in terms
            of the others', by the same covariance.
    """

    time_s: Array
    value_mm: Array
    sigma_mm: Array
    size_sigma: float = 0.0

    def only(self, use: Mask | Indices) -> "Movement":
        """The movement at some of the fields."""
        return Movement(self.time_s[use], self.value_mm[use], self.sigma_mm[use], self.size_sigma)

    def speed_mm_per_s(self, time_s: Array) -> Array:
        """(N,) speed within the step before or after each time, whichever is greater."""
        step_s = float(np.median(np.diff(self.time_s)))
        moments = (time_s - step_s, time_s, time_s + step_s)
        before, now, after = (np.interp(at_s, self.time_s, self.value_mm) for at_s in moments)
        return np.maximum(np.abs(now - before), np.abs(after - now)) / step_s


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
    xyz, covariance = _often_seen(tracks(fields))
    mean, direction = _mean_and_direction(xyz)
    value, sigma = _along(xyz - mean, covariance, direction)
    size_sigma = _size_sigma(covariance, direction, value)
    times = np.array([field.time_s for field in fields])
    movements, first = [], 0
    for capture in captures:
        of = np.arange(first, first + len(capture))
        of = of[np.isfinite(value[of])]
        movements.append(Movement(times[of], value[of], sigma[of], size_sigma))
        first += len(capture)
    return movements


def _often_seen(all_tracks: Tracks) -> tuple[Array, Array]:
    """(F, N, 3) places and (F, N, 3, 3) their covariance of the targets that count; NaN where not seen."""
    often = np.isfinite(all_tracks.xyz_mm[..., 0]).mean(axis=0) >= _SEEN_IN
    if not often.any():
        raise AnalysisError("no target is seen in half of the fields", _NO_POINTS)
    return all_tracks.xyz_mm[:, often], all_tracks.covariance_mm2[:, often]


def _mean_and_direction(xyz: Array) -> tuple[Array, Array]:
    """(N, 3) mean places over all fields, and movements of the targets per mm of the one that moves most.

    A rank-one approximation with a place of its own for every target: one that hides while the wall is closed
    has been seen on one side of its mean alone.
    """
    seen = np.isfinite(xyz[..., 0])
    filled = np.where(seen[..., np.newaxis], xyz, 0.0)
    count = seen.sum(axis=0)
    mean: Array = filled.sum(axis=0) / count[:, np.newaxis]
    moved = np.where(seen[..., np.newaxis], xyz - mean, 0.0)
    direction = np.linalg.svd(moved.reshape(len(moved), -1), full_matrices=False)[2][0].reshape(-1, 3)
    for _ in range(_ROUNDS):
        amount = _amount(np.where(seen[..., np.newaxis], xyz - mean, 0.0), seen, direction)
        amount -= amount.mean()
        centre = (seen * amount[:, np.newaxis]).sum(axis=0) / count
        about = np.where(seen, amount[:, np.newaxis] - centre, 0.0)
        share = np.maximum((about**2).sum(axis=0), 1e-30)
        direction = np.einsum("fn,fnx->nx", about, filled) / share[:, np.newaxis]
        mean = filled.sum(axis=0) / count[:, np.newaxis] - centre[:, np.newaxis] * direction
        direction /= max(float(np.linalg.norm(direction, axis=1).max()), 1e-30)
    # The sign of a singular vector is arbitrary: towards the cameras, so that open is high.
    turned: Array = direction if direction[:, 2].sum() >= 0 else -direction
    return mean, turned


def _amount(filled: Array, seen: Mask, direction: Array) -> Array:
    share = seen @ (direction**2).sum(axis=1)
    return np.einsum("fnx,nx->f", filled, direction) / np.maximum(share, 1e-30)


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


def _size_sigma(covariance: Array, direction: Array, value: Array) -> float:
    """Relative σ of the movement of the target that moves most: its direction has the length 1."""
    most = int(np.linalg.norm(direction, axis=1).argmax())
    along, noise = direction[most], covariance[:, most]
    seen = np.isfinite(noise[:, 0, 0]) & np.isfinite(value)
    amount, each = value[seen], np.einsum("x,fxy,y->f", along, noise[seen], along)
    return float(np.sqrt((amount**2 * each).sum()) / max(float((amount**2).sum()), 1e-30))
