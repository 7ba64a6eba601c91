"""The accuracy investigation (paper 4): the points of a capture compared with the truth."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.chain.light import field_threshold
from grabberd.core.field import BIT_DEPTHS, Field, NumberedField, PackedField, double_lines, quantise, unpack
from grabberd.core.measurement import ThresholdRule
from grabberd.core.reconstruction.accuracy import (
    WRONG_BEYOND_MM,
    Accuracy,
    Axes,
    Coordinates,
    LengthErrors,
    PointingPrecision,
    RigidMotion,
    Truth,
    accuracy,
    length_errors,
    pointing_precision,
    true_places,
)
from grabberd.core.reconstruction.points import Points, PointSeries
from grabberd.core.reconstruction.smoothing import Smoothed, SmoothingSettings, smooth
from grabberd.errors import InputError, MeasurementError

PAPER_LIMIT_MM = 0.2
"""Length-measuring error that the paper allows its system."""
_MOST_BITS = 8


@dataclass(frozen=True, slots=True)
class InvestigationSettings:
    """Settings of the comparison of points with the truth.

    Attributes:
        fit: turn and shift the points onto the truth first, one motion for all fields; never scale.
        limit_mm: greatest allowed length-measuring error.
        bits: bits per pixel of the fields from which the points were measured.
        interlaced: False if those are progressive pictures.
        smoothing: settings of the smoothing over time; `bits` and `interlaced` there are replaced by these.
    """

    fit: bool = False
    limit_mm: float = PAPER_LIMIT_MM
    bits: int = 1
    interlaced: bool = True
    smoothing: SmoothingSettings = field(default_factory=SmoothingSettings)


@dataclass(frozen=True, slots=True)
class Compared:
    """Points against the truth.

    Attributes:
        accuracy: errors as in the paper's Table 1.
        lengths: length-measuring error, or None if it cannot be determined; `no_lengths` is then the reason.
        chi2: mean of e·C⁻¹·e / 3 over the points, C with the calibration's share: 1 if the reported σ are
            the true ones; `chi2_axes`: the same for X, Y and Z separately.
        sigma: root mean square of the points' reported σ.
        calibration_sigma: root mean square of the calibration's share of it.
    """

    accuracy: Accuracy
    lengths: LengthErrors | None
    no_lengths: str | None
    chi2: float
    chi2_axes: tuple[float, float, float]
    sigma: Axes
    calibration_sigma: Axes


@dataclass(frozen=True, slots=True)
class Investigation:
    """One capture's points, field by field and smoothed.

    Attributes:
        bits: bits per pixel.
        single: points of the single fields.
        smoothed: points smoothed over time, at the same fields and targets.
        smoothing: result of the smoother.
        pointing: precision of image coordinates; None if the object moves.
    """

    bits: int
    single: Compared
    smoothed: Compared
    smoothing: Smoothed
    pointing: PointingPrecision | None


def investigate(
    measured: Iterable[tuple[int, int, Points]], truth: Truth, settings: InvestigationSettings
) -> Investigation:
    """Compares points with the truth, both unsmoothed and smoothed over time.

    Args:
        measured: number, time in ns and points of every field, in order.
        truth: true positions of the targets.
        settings: settings of the comparison.

    Raises:
        MeasurementError: no point could be matched, or a rigid fit is not determined.
    """
    series = PointSeries.of(measured)
    single = _compared(series, truth, settings)
    known = replace(settings.smoothing, bits=settings.bits, interlaced=settings.interlaced)
    smoothing = smooth(series, known)
    return Investigation(
        bits=settings.bits,
        single=single,
        smoothed=_compared(smoothing.points, truth, settings),
        smoothing=smoothing,
        pointing=pointing_precision(series) if truth.still else None,
    )


def _compared(series: PointSeries, truth: Truth, settings: InvestigationSettings) -> Compared:
    table = accuracy(Coordinates.of_series(series), truth, fit=settings.fit)
    true = true_places(truth, series)
    lengths, reason = _lengths(series, true, settings.limit_mm)
    chi2, axes = _chi2(series, true, table.fitted)
    own = np.diagonal(series.covariance_mm2, axis1=2, axis2=3)[series.seen].mean(axis=0)
    share = np.diagonal(series.calibration_covariance_mm2, axis1=2, axis2=3)[series.seen].mean(axis=0)
    return Compared(table, lengths, reason, chi2, axes, Axes.of(own + share), Axes.of(share))


def _lengths(series: PointSeries, true: Array, limit_mm: float) -> tuple[LengthErrors | None, str | None]:
    try:
        return length_errors(series.target, series.xyz_mm, true, limit_mm), None
    except MeasurementError as error:
        return None, error.message


def _chi2(
    series: PointSeries, true: Array, fitted: RigidMotion | None
) -> tuple[float, tuple[float, float, float]]:
    places = fitted.apply(series.xyz_mm) if fitted else series.xyz_mm
    covariance = series.covariance_mm2 + series.calibration_covariance_mm2
    # The covariance has to follow the fit's rotation, or X, Y and Z would be weighted by the wrong axes.
    covariance = fitted.turn(covariance) if fitted else covariance
    error = places - true
    # Mismatched targets are counted as wrong elsewhere; one of them would outweigh all others in a mean
    # square. Targets that were not seen are NaN, and infinity keeps them out.
    matched = np.linalg.norm(np.nan_to_num(error, nan=np.inf), axis=2) <= WRONG_BEYOND_MM
    off, expected = error[matched], covariance[matched]
    whole = (off * np.linalg.solve(expected, off[:, :, np.newaxis])[:, :, 0]).sum(axis=1).mean() / 3.0
    x, y, z = (off**2 / np.diagonal(expected, axis1=1, axis2=2)).mean(axis=0).tolist()
    return float(whole), (x, y, z)


def requantised(fields: Iterable[NumberedField], bits: int, *, doubled: bool) -> Iterator[NumberedField]:
    """Requantises the fields of an 8-bit capture as if they had been taken with fewer bits, 1…8.

    The threshold is chosen for these bits from the first field, as is done when a ring is configured.

    Args:
        fields: fields of 8 bits with their original lines.
        bits: bits per pixel; depths that no ring has, such as 7, are allowed.
        doubled: interpolate the missing lines from the grey values.

    Raises:
        InputError: the fields have fewer bits, or their lines are doubled.
    """
    threshold: int | None = None
    for numbered in fields:
        grey = _grey(numbered.packed)
        if threshold is None:
            threshold = field_threshold(grey, ThresholdRule(), bits, doubled=doubled)
        whole = double_lines(grey) if doubled else grey
        yield numbered._replace(packed=_quantised(whole, bits, threshold))


def _grey(packed: PackedField) -> Field:
    if packed.bits != _MOST_BITS or packed.is_doubled:
        kind = "doubled" if packed.is_doubled else "intact"
        raise InputError(
            f"fields of {packed.bits} bits with {kind} lines cannot be requantised",
            "capture with --bits 8 --lines field",
        )
    return unpack(packed)


def _quantised(field: Field, bits: int, threshold: int) -> PackedField:
    """Quantise to a number of bits that no ring has, keeping the result in eight."""
    if bits in BIT_DEPTHS:
        return quantise(field, bits, threshold)
    # The bits that are cut off are replaced by half their range: the quantisation error then has mean zero.
    low = np.uint8((1 << (_MOST_BITS - bits)) - 1)
    return quantise(replace(field, luma=(field.luma & ~low) | (low + 1) // 2), _MOST_BITS, threshold)
