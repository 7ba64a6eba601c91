"""Smoothing of points over time, target by target: a motion model, and errors that are not all white.

The motion is a constant velocity disturbed by white acceleration, found anew for every interval. A point's
error, apart from the calibration's, has three parts: *white*, drawn anew for every field; *opposite*, locked
to the target's position between the pixels and different for the two parities; and *common*, locked likewise,
but equal for both. The locked ones are states of their own, a Gauss–Markov process that forgets as the image
moves, so that an object at rest does not average them. The calibration's covariance is common to all fields
and is passed on unchanged.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction.kalman_chains import (
    Chains,
    SmoothedChains,
    likelihood,
    manoeuvres,
    smoothed_chains,
)
from grabberd.core.reconstruction.points import PointSeries
from grabberd.errors import MeasurementError

_LOCKED = {True: {1: 0.09, 2: 0.12, 3: 0.06}, False: {1: 0.2, 2: 0.48, 3: 0.2}}
_LOCKED_OF_GREY = {True: 0.022, False: 0.05}
"""Share of a point's variance that stays while its image rests, of fields of both parities and of progressive
pictures; for few bits and for more. From simulated points at rest, with 2 % noise and line jitter of .12 px.
"""
_LEAST_WHITE = 0.02
_LEAST_PAIRS = 60
_LEAST_TARGETS = 3
_REST_S = 0.04
"""Time between fields that are compared to tell rest from movement, which is slower than noise."""


def locked_share(bits: int, *, interlaced: bool = True) -> float:
    """Share of a point's variance, without the calibration's, that stays in a mean while its image rests.

    The error is locked to the target's place between the pixels, and equal in fields of both parities; what
    differs between the parities goes in a mean over as many of either.

    Args:
        bits: Bits per pixel of the fields that the points come from.
        interlaced: False if those are progressive pictures, which show the same lines every time.
    """
    return _LOCKED[interlaced].get(bits, _LOCKED_OF_GREY[interlaced])


@dataclass(frozen=True, slots=True, eq=False)
class ErrorShares:
    """Variances in units of the points' own; their sum is 1 where the points' covariance is right.

    Attributes:
        white: (3,) in X, Y and Z.
        opposite: (3,) likewise.
        common: (3,) likewise.
    """

    white: Array
    opposite: Array
    common: Array

    @classmethod
    def all_white(cls) -> "ErrorShares":
        """Errors that are wholly white."""
        return cls(np.ones(3), np.zeros(3), np.zeros(3))

    @classmethod
    def of(cls, series: PointSeries, rest: Mask, bits: int, *, interlaced: bool = True) -> "ErrorShares":
        """Estimate from the fields in which the object rests; all white if there are too few.

        Args:
            series: The points.
            rest: (F,) True for fields in which the object rests.
            bits: Bits per pixel of the fields that the points come from.
            interlaced: True if they alternate in parity; progressive pictures show the same lines every time.
        """
        same, own = _half_variance(series, 2 if interlaced else 1, rest)
        other, others = _half_variance(series, 1, rest) if interlaced else (same, own)
        if min(own, others) < _LEAST_PAIRS:
            return cls.all_white()
        white = same.clip(_LEAST_WHITE)
        opposite = 0.5 * (other - same).clip(0.0)
        seen = white + opposite
        common = locked_share(bits, interlaced=interlaced) * seen
        return cls(white, opposite, np.maximum(common, 1.0 - seen) if bits == 1 else common)


def rest_fields(series: PointSeries, *, interlaced: bool = True) -> Mask:
    """(F,) True for fields that differ from those around them no more than the quietest do.

    Detecting rest in a single field takes several targets; movements small beside the errors go unnoticed.
    """
    lag = _rest_lag(series, interlaced)
    differ, count = _differences(series, lag)
    if not np.isfinite(differ).any():
        return np.zeros(len(series.n), np.bool_)
    spread = math.sqrt(2.0 / (3.0 * float(np.median(count[count > 0]))))
    quiet = differ <= float(np.nanquantile(differ, 0.1)) * (1.0 + max(1.0, 4.3 * spread))
    rest: Mask = quiet.copy()
    for shift in range(1, lag + 1):
        rest[:-shift] &= quiet[shift:]
    return rest


def _rest_lag(series: PointSeries, interlaced: bool) -> int:
    """Number of fields in `_REST_S`; an even one if they alternate in parity."""
    steps = np.diff(series.n)
    if not len(steps):
        return 2
    period_s = float(np.median(np.diff(series.time_s) / np.maximum(steps, 1)))
    fields = _REST_S / period_s if period_s > 0 else 2.0
    return 2 * max(round(fields / 2), 1) if interlaced else max(round(fields), 1)


def _differences(series: PointSeries, lag: int) -> tuple[Array, Indices]:
    """(F,) mean squared difference from `lag` fields before, over all targets, in units of the variance.

    NaN where too few targets can be compared; also the number of targets compared.
    """
    squares, both = _squares(series, lag)
    count = both.sum(axis=1)
    total = np.where(both[..., np.newaxis], squares, 0.0).sum(axis=(1, 2)) / 3.0
    differ = np.full(len(series.n), np.nan)
    enough = count >= min(_LEAST_TARGETS, len(series.target))
    differ[enough] = total[enough] / count[enough]
    return differ, count


def _half_variance(series: PointSeries, lag: int, rest: Mask) -> tuple[Array, int]:
    """(3,) mean of half the squared differences of fields `lag` steps apart, and their number."""
    squares, both = _squares(series, lag)
    both &= rest[:, np.newaxis]
    return (squares[both].mean(axis=0) if both.any() else np.ones(3)), int(both.sum())


def _squares(series: PointSeries, lag: int) -> tuple[Array, Mask]:
    """(F, T, 3) half the squared difference from `lag` steps before, in units of the variance."""
    earlier = np.searchsorted(series.n, series.n - lag)
    there = series.n[earlier] == series.n - lag
    both = series.seen & series.seen[earlier] & there[:, np.newaxis]
    variance = np.diagonal(series.covariance_mm2, axis1=2, axis2=3)
    squares: Array = 0.5 * (series.xyz_mm - series.xyz_mm[earlier]) ** 2 / variance
    return squares, both


REST = 0.0
"""Zero acceleration: the object stands still."""
_ROUNDS = 4


@dataclass(frozen=True, slots=True)
class SmoothingSettings:
    """Settings of smoothing.

    Attributes:
        bits: Bits per pixel of the fields that the points come from: with few, less of the error is white.
        interlaced: False if those are progressive pictures, which have no parity.
        acceleration_mm_s2: Standard deviation of the acceleration, drawn anew every 20 ms whatever the rate;
            None finds it for every interval; `REST` if the object stands still.
        shares: White and locked parts of the errors; None estimates them from the points.
        forgets_px: Image movement over which a locked error falls to 1/e.
        gate: Deviation in standard deviations beyond which a point is left out.
    """

    bits: int = 1
    interlaced: bool = True
    acceleration_mm_s2: float | None = None
    shares: ErrorShares | None = None
    forgets_px: float = 0.25
    gate: float = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Smoothed series, at every field from a target's first point to its last.

    Attributes:
        series: The smoothed points, their covariance without the calibration's; NaN outside a target's time.
        velocity_mm_s: (F, T, 3).
        measured: (F, T) True where a measured point was used; elsewhere the motion model bridges a gap.
        left_out: (F, T) True for points that contradict the others.
        acceleration_mm_s2: (F,) acceleration used since the previous field, root mean square over all
            targets and axes.
        shares: Error shares used.
    """

    series: PointSeries
    velocity_mm_s: Array
    measured: Mask
    left_out: Mask
    acceleration_mm_s2: Array
    shares: ErrorShares

    @property
    def points(self) -> PointSeries:
        """The smoothed points that have a measured one, without those that only bridge a gap."""
        return self.series.without(~self.measured)


def smooth(series: PointSeries, settings: SmoothingSettings | None = None) -> Smoothed:
    """Smooth the points of a series over time.

    Raises:
        MeasurementError: There are no points.
    """
    settings = settings or SmoothingSettings()
    if not series.seen.any():
        raise MeasurementError(
            f"there are no points to smooth in {len(series.n)} fields",
            "check threshold, calibration and object model: nothing was found",
        )
    rest = rest_fields(series, interlaced=settings.interlaced)
    acceleration = _acceleration(series, settings)
    shares = settings.shares or ErrorShares.of(series, rest, settings.bits, interlaced=settings.interlaced)
    left_out = np.zeros(series.seen.shape, np.bool_)
    for _ in range(_ROUNDS):
        result = _smooth(series.without(left_out), acceleration, shares, settings)
        contradicted = _contradicted(series, result.series, settings.gate) & ~left_out
        if not contradicted.any():
            break
        left_out |= contradicted
    return replace(result, left_out=left_out)


def _smooth(
    series: PointSeries, acceleration: Array, shares: ErrorShares, settings: SmoothingSettings
) -> Smoothed:
    """Smooth once as if all errors were white, to learn how the targets move; then with locked errors."""
    chains = _chains(series, acceleration)
    moved_px = _moved_px(series, smoothed_chains(chains).value_mm)
    targets = len(series.target)
    sign: Array = np.where(series.parity, -1.0, 1.0)[:, np.newaxis]
    sigma: Array = np.sqrt(chains.white_mm2)
    divided = replace(
        chains,
        white_mm2=np.tile(shares.white, targets) * chains.white_mm2,
        common_mm=np.sqrt(np.tile(shares.common, targets)) * sigma,
        opposite_mm=sign * np.sqrt(np.tile(shares.opposite, targets)) * sigma,
        keeps=np.repeat(np.exp(-moved_px / settings.forgets_px), 3, axis=1),
    )
    if settings.acceleration_mm_s2 is None and acceleration.any():
        # Once more: of errors that stay with the position, less is movement than if they were white.
        acceleration = manoeuvres(divided)
        divided = replace(divided, acceleration_mm_s2=acceleration)
    return _result(series, smoothed_chains(divided), acceleration, shares)


def _chains(series: PointSeries, acceleration: Array) -> Chains:
    """Make a chain of X, Y and Z of every target, with white errors only."""
    variance = np.diagonal(series.covariance_mm2, axis1=2, axis2=3)
    flat = (len(series.n), -1)
    nothing = np.zeros_like(series.xyz_mm).reshape(flat)
    return Chains(
        value_mm=series.xyz_mm.reshape(flat),
        white_mm2=np.where(series.seen[:, :, np.newaxis], variance, 1.0).reshape(flat),
        common_mm=nothing,
        opposite_mm=nothing,
        keeps=np.ones_like(nothing),
        elapsed_s=np.diff(series.time_s, prepend=series.time_s[0]),
        acceleration_mm_s2=acceleration.reshape(len(series.n), -1),
    )


def _acceleration(series: PointSeries, settings: SmoothingSettings) -> Array:
    """(F, B) acceleration as given, or as shown; none, if standing still explains the points as well."""
    still = _chains(series, np.full((len(series.n), 1), REST))
    if settings.acceleration_mm_s2 is not None:
        return still.acceleration_mm_s2 + settings.acceleration_mm_s2
    moving = replace(still, acceleration_mm_s2=manoeuvres(still))
    # Every interval's acceleration is a parameter more (Akaike).
    gain = likelihood(moving).sum() - likelihood(still).sum()
    return moving.acceleration_mm_s2 if gain > len(series.n) else still.acceleration_mm_s2


def _moved_px(series: PointSeries, flat_mm: Array) -> Array:
    """(F, T) movement of a target's image since the previous field."""
    xyz_mm = flat_mm.reshape(series.xyz_mm.shape)
    moved_mm = np.linalg.norm(np.diff(xyz_mm, axis=0, prepend=xyz_mm[:1]), axis=2)
    spread_px = np.nanvar(series.image_px, axis=(0, 1)).sum() / 2.0
    spread_mm = np.nanvar(series.xyz_mm, axis=(0, 1)).sum()
    return moved_mm * np.sqrt(spread_px / spread_mm) if spread_mm else moved_mm


def _result(
    series: PointSeries, chains: SmoothedChains, acceleration: Array, shares: ErrorShares
) -> Smoothed:
    """Restore the series' shape; correlations of X, Y and Z remain those of the measured points."""
    shape, seen = series.xyz_mm.shape, series.seen
    inside = np.logical_or.accumulate(seen) & np.logical_or.accumulate(seen[::-1])[::-1]
    outside = np.where(inside, 0.0, np.nan)[:, :, np.newaxis]
    nearest = _nearest_seen(seen)
    targets = np.arange(shape[1])
    measured = series.covariance_mm2[nearest, targets]
    variance = chains.variance_mm2.reshape(shape).clip(0.0)
    scale = np.sqrt(variance / np.diagonal(measured, axis1=2, axis2=3)) + outside
    smoothed = replace(
        series,
        xyz_mm=chains.value_mm.reshape(shape) + outside,
        covariance_mm2=measured * scale[..., np.newaxis] * scale[..., np.newaxis, :],
        calibration_covariance_mm2=series.calibration_covariance_mm2[nearest, targets]
        + outside[..., np.newaxis],
    )
    rate = chains.rate_mm_s.reshape(shape) + outside
    used = np.sqrt((acceleration.reshape(len(seen), -1) ** 2).mean(axis=1))
    return Smoothed(smoothed, rate, seen, np.zeros_like(seen), used, shares)


def _nearest_seen(seen: Mask) -> Indices:
    """(F, T) index of the last field up to this one in which a target was seen; else of its first."""
    index = np.where(seen, np.arange(len(seen))[:, np.newaxis], -1)
    last = np.maximum.accumulate(index, axis=0)
    return np.where(last >= 0, last, seen.argmax(axis=0))


def _contradicted(series: PointSeries, smoothed: PointSeries, gate: float) -> Mask:
    """(F, T) True for points too far from the smoothed ones, and farther than the points beside them."""
    off = series.xyz_mm - smoothed.xyz_mm
    variance = np.diagonal(series.covariance_mm2 + smoothed.covariance_mm2, axis1=2, axis2=3)
    far = np.nan_to_num((off * off / variance).max(axis=2))
    padded = np.pad(far, ((2, 2), (0, 0)))
    around = np.max([padded[shift : shift + len(far)] for shift in range(5)], axis=0)
    return (far > gate**2) & (far == around)
