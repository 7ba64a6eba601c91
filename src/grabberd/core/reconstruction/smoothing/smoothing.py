"""Smoothing of points over time, target by target: a motion model, and errors that are not all white.

The motion is a constant velocity disturbed by white acceleration, whose size is found anew for every interval
between two fields (`manoeuvres`); standing still is the limit. The errors have a
white part and two parts locked to the target's position between the pixels (`ErrorShares`): those are states
of their own, a Gauss–Markov process that forgets as the image moves, so that an object at rest does not
average them. The calibration's covariance is common to all fields and is passed on unchanged.

X, Y and Z are filtered separately: Kalman forward, and backward after Bryson and Frazier, which needs no
inverse covariance and therefore works without any motion noise.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.point_series import PointSeries
from grabberd.core.reconstruction.smoothing.error_shares import ErrorShares, rest_fields
from grabberd.core.reconstruction.smoothing.kalman_chains import (
    Chains,
    SmoothedChains,
    likelihood,
    smoothed_chains,
)
from grabberd.core.reconstruction.smoothing.manoeuvres import manoeuvres
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
    moved: Array = moved_mm * np.sqrt(spread_px / spread_mm) if spread_mm else moved_mm
    return moved


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


def _nearest_seen(seen: Mask) -> NDArray[np.intp]:
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
    contradicted: Mask = (far > gate**2) & (far == around)
    return contradicted
