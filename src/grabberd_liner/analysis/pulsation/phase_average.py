"""The mean cycle of every target: its position at any phase, averaged over cycles and bursts, with σ; and
the variation of each cycle's start, length and stroke against it.

Each coordinate is a Fourier series of the phase, fitted to all fields: they need not fall on the same phases
in different cycles, and movement between two fields is not smeared. A wall that closes within two fields has
more harmonics than single targets determine. The higher ones are taken from the movement of the wall, which
all targets determine together: without them a still wall would seem to swing, all targets alike.

Averaging reduces noise from pointing and line jitter; the calibration's covariance is common to all fields
and remains. Targets that one view alone sees are averaged in that view's image likewise.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction import Points, SingleViewImages
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.movement import Movement, TimedPoints, Tracks, basis, tracks
from grabberd_liner.analysis.pulsation.pulsation import Pulsation

_FEWEST = 3
"""Fewer harmonics cannot follow the plateaus of a pulsation."""
_HALF_WAVE = 0.5
"""Greatest gap in phase, in waves of the highest harmonic: a longer one lets the series swing freely."""
_SLACK = 1.5
"""Fields per coefficient; fewer leave no freedom to estimate how cycles differ."""
_DEGREE = 3
"""Of a target's place as a polynomial of the wall's movement, beside its own harmonics."""
_NOTHING_NEW = 1e-5
"""Share of the movement, below the noise of any field."""


class PhaseAverage(NamedTuple):
    """The mean cycle at P phases.

    Attributes:
        phase: (P,) in cycles from the beginning of wall phase a.
        points: (P,) targets at each phase, with averaged noise and the full covariance of the calibration;
            image coordinates and residuals are NaN, since nothing was observed there. Targets that one view
            sees throughout, but not both, are among the images of a single view.
        correlation: (P, P) of the noise of places at two phases: neighbours come from the same fields.
    """

    phase: Array
    points: tuple[Points, ...]
    correlation: Array


def phase_average(
    captures: Sequence[Sequence[TimedPoints]], pulsation: Pulsation, phase: Array
) -> PhaseAverage:
    """Points of the mean cycle.

    Args:
        captures: fields from which `pulsation` was determined; those outside its runs are ignored.
        pulsation: result of `fit_pulsation`.
        phase: (P,) requested phases, from the beginning of wall phase a.

    Raises:
        AnalysisError: no target is seen throughout the cycle.
    """
    moments = [
        pulsation.at(np.array([field.time_s for field in capture]), index)
        for index, capture in enumerate(captures)
    ]
    inside = np.concatenate([moment.run for moment in moments]) >= 0
    fields = [field for capture in captures for field in capture]
    all_tracks = tracks([field for field, used in zip(fields, inside, strict=True) if used])
    at = np.concatenate([moment.phase for moment in moments])[inside]
    wanted, series = np.asarray(phase, np.float64), _Series(pulsation)
    averages = list(_averages(all_tracks.xyz_mm, all_tracks.covariance_mm2, at, wanted, series))
    good = np.array(sorted(index for average in averages for index in average.place), np.intp)
    if not len(good):
        raise AnalysisError(
            "no target is seen in the whole cycle", "capture longer, or more bursts; check what hides targets"
        )
    found = [field.points for field, used in zip(fields, inside, strict=True) if used]
    single = _single(found, all_tracks.target[good], at, wanted, series)
    return _joined(all_tracks, averages, good, wanted, single)


class _Series:
    """Terms of a target's place over the phase.

    Args:
        pulsation: of the wall.
    """

    def __init__(self, pulsation: Pulsation) -> None:
        self._harmonics, self._waveform = pulsation.field_harmonics, pulsation.waveform
        low_mm, high_mm = pulsation.waveform.levels()
        self._middle_mm, self._half_mm = (high_mm + low_mm) / 2, (high_mm - low_mm) / 2

    def count(self, at: Array) -> int:
        """Number of harmonics that fields at phases determine, from their number and the widest gap."""
        if len(at) < 2:
            return 0
        ordered = np.sort(at)
        hole = float(np.diff(np.concatenate([ordered, [ordered[0] + 1]])).max())
        return min(self._harmonics, int(_HALF_WAVE / hole), int((len(at) / _SLACK - 1 - _DEGREE) / 2))

    def terms(self, phase: Array, count: int) -> Array:
        """(P, 2 count + 1 + `_DEGREE`) harmonics at phases (P,), then powers of the movement from −1 to 1."""
        moved = (self._waveform.value(phase) - self._middle_mm) / self._half_mm
        powers = moved[:, np.newaxis] ** np.arange(1, _DEGREE + 1)
        return np.concatenate([basis(phase, count), powers], axis=1)


class _Average(NamedTuple):
    """Averages of targets seen in the same fields: (M,), (P, M, D), (P, M, D, D); and (P, P)."""

    place: Indices
    value: Array
    covariance: Array
    correlation: Array


def _averages(
    values: Array, covariance: Array, at: Array, phase: Array, series: _Series
) -> Iterator[_Average]:
    """Averages of D coordinates of targets (F, N, D); NaN where one was not seen."""
    seen = np.isfinite(values[..., 0])
    # Targets seen in the same fields share one design matrix, so it is inverted once for all of them.
    patterns, which = np.unique(seen, axis=1, return_inverse=True)
    for k in range(patterns.shape[1]):
        use = patterns[:, k]
        count = series.count(at[use])
        if count >= _FEWEST:
            index = np.flatnonzero(which == k)
            chosen = values[np.ix_(use, index)], covariance[np.ix_(use, index)]
            yield _average(index, *chosen, series.terms(at[use], count), series.terms(phase, count))


def _average(index: Indices, values: Array, covariance: Array, terms: Array, wanted: Array) -> _Average:
    """Least squares with equal weights for all fields; the covariance is propagated from theirs."""
    # A movement without steep flanks has no more harmonics than the series: then its powers tell nothing new.
    solve = np.linalg.pinv(terms, rcond=_NOTHING_NEW)
    share = wanted @ solve
    mean = np.einsum("pf,fnx->pnx", share, values)
    noise = np.einsum("pf,fnxy->pnxy", share**2, covariance, optimize=True)
    left = values - np.einsum("gf,fnx->gnx", terms @ solve, values)
    kept = np.maximum(1 - np.einsum("fi,if->f", terms, solve), 0.0)
    dimensions = values.shape[-1]
    freedom = dimensions * kept.sum()
    expected = np.einsum("f,fnxx->n", kept, covariance) / freedom
    found = (left**2).sum(axis=(0, 2)) / freedom
    variation = np.sqrt(np.maximum(found - expected, 0.0))
    more = np.einsum("pf,n->pn", share**2, variation**2)
    deviation = np.linalg.norm(share, axis=1)
    return _Average(
        index,
        mean,
        noise + more[..., None, None] * np.eye(dimensions),
        share @ share.T / np.outer(deviation, deviation),
    )


def _single(
    fields: Sequence[Points],
    averaged: NDArray[np.int32],
    at: Array,
    phase: Array,
    series: _Series,
) -> Sequence[SingleViewImages | None]:
    """Images at each phase of targets without a mean point that one view sees throughout the cycle.

    Args:
        fields: points of F fields.
        averaged: ids of targets with a mean point.
        at: (F,) phases of the fields.
        phase: (P,) requested phases.
        series: terms of the averages.
    """
    sought = [field.single.target for field in fields if field.single is not None]
    target = np.setdiff1d(np.concatenate(sought or [averaged]), averaged).astype(np.int32)
    if not len(target):
        return [None] * len(phase)
    images, variance = _images(fields, target)
    covariance = variance[..., np.newaxis] * np.eye(2)
    found = [average for average in _averages(images, covariance, at, phase, series) if len(average.place)]
    place = np.concatenate([average.place for average in found] or [np.empty(0, np.intp)])
    # Both views may see a target throughout, each by itself; two images without a point are a contradiction.
    alone = np.flatnonzero(np.bincount(place // 2, minlength=len(target))[place // 2] == 1)
    order = alone[np.argsort(place[alone])]
    if not len(order):
        return [None] * len(phase)
    value = np.concatenate([average.value for average in found], axis=1)[:, order]
    sigma = np.sqrt(
        np.concatenate([average.covariance for average in found], axis=1)[:, order].diagonal(0, 2, 3)
    )
    of = place[order]
    return [SingleViewImages(target[of // 2], of % 2, value[p], sigma[p]) for p in range(len(phase))]


def _images(fields: Sequence[Points], target: NDArray[np.int32]) -> tuple[Array, Array]:
    """(F, 2 N, 2) images of targets (N,) in the left and right view, and their variances; NaN where unseen.

    A point's images count as well. They have the typical variance of a single view's.
    """
    images = np.full((len(fields), len(target), 2, 2), np.nan)
    variance = np.full_like(images, np.nan)
    for k, points in enumerate(fields):
        both, own = np.isin(points.target, target), np.searchsorted(target, points.target)
        images[k, own[both]] = points.image_px[both]
        if (single := points.single) is not None:
            alone, own = np.isin(single.target, target), np.searchsorted(target, single.target)
            images[k, own[alone], single.view[alone]] = single.image_px[alone]
            variance[k, own[alone], single.view[alone]] = single.sigma_px[alone] ** 2
    typical = np.nanmedian(variance, axis=(0, 1, 2))
    variance = np.where(np.isnan(variance), typical, variance)
    return images.reshape(len(fields), -1, 2), variance.reshape(len(fields), -1, 2)


def _joined(
    all_tracks: Tracks,
    averages: Sequence[_Average],
    good: Indices,
    phase: Array,
    single: Sequence[SingleViewImages | None],
) -> PhaseAverage:
    order = np.argsort(np.concatenate([average.place for average in averages]))
    xyz = np.concatenate([average.value for average in averages], axis=1)[:, order]
    covariance = np.concatenate([average.covariance for average in averages], axis=1)[:, order]
    return PhaseAverage(
        phase,
        tuple(_points(all_tracks, good, xyz[p], covariance[p], one) for p, one in enumerate(single)),
        # Targets that hide at times have fewer fields; most of them share those of the largest group.
        max(averages, key=lambda average: len(average.place)).correlation,
    )


def _points(
    all_tracks: Tracks,
    good: Indices,
    xyz: Array,
    covariance: Array,
    single: SingleViewImages | None,
) -> Points:
    return Points(
        all_tracks.target[good],
        xyz,
        covariance,
        all_tracks.calibration_covariance_mm2[good],
        np.full((len(good), 2, 2), np.nan),
        np.full(len(good), np.nan),
        single,
    )


_WHOLE = 0.8
"""Share of a cycle's fields that have to be present."""


class Variation(NamedTuple):
    """C whole cycles of all runs, in order.

    Attributes:
        start_s: (C,) start of each cycle (wall phase a) by its movement in time, with σ.
        stroke: (C,) stroke relative to the mean cycle's, with σ.
        lengths_s: time from the start of each cycle to that of the next, if both are whole, with σ.
    """

    start_s: Estimate
    stroke: Estimate
    lengths_s: Estimate


def variation(movements: Sequence[Movement], pulsation: Pulsation) -> Variation:
    """Shift and size of every whole cycle against the mean one."""
    rows = [
        row for capture, movement in enumerate(movements) for row in _cycles(movement, capture, pulsation)
    ]
    table = np.array(rows).reshape(-1, 6)
    start = Estimate(table[:, 2], table[:, 3])
    follows = np.flatnonzero((np.diff(table[:, 0]) == 0) & (np.diff(table[:, 1]) == 1))
    lengths = np.diff(table[:, 2])[follows]
    spread = np.hypot(table[follows, 3], table[follows + 1, 3])
    return Variation(start, Estimate(table[:, 4], table[:, 5]), Estimate(lengths, spread))


def _cycles(movement: Movement, capture: int, pulsation: Pulsation) -> list[tuple[float, ...]]:
    """(run, cycle, start, σ, stroke, σ) of the whole cycles of a capture."""
    at = pulsation.at(movement.time_s, capture)
    step_s = float(np.median(np.diff(movement.time_s)))
    least = _WHOLE * pulsation.period_s / step_s
    rows: list[tuple[float, ...]] = []
    for run, cycle in sorted({(int(r), int(c)) for r, c in zip(at.run, at.cycle, strict=True) if r >= 0}):
        use = (at.run == run) & (at.cycle == cycle)
        if use.sum() >= least:
            begun_s = pulsation.runs[run].start_s + cycle * pulsation.period_s
            shift, shift_sigma, stroke, stroke_sigma = _against(movement, use, at.phase[use], pulsation)
            rows.append((run, cycle, begun_s + shift, shift_sigma, stroke, stroke_sigma))
    return rows


def _against(
    movement: Movement, use: Mask, phase: Array, pulsation: Pulsation
) -> tuple[float, float, float, float]:
    """Least squares of level, size and delay of one cycle against the mean one."""
    mean, slope = pulsation.waveform.value(phase), pulsation.waveform.slope(phase) / pulsation.period_s
    # Never better than the periodic model itself: its residuals include what is not noise.
    sigma = np.maximum(movement.sigma_mm[use], pulsation.residual_mm)
    design = np.column_stack([np.ones_like(mean), mean, -slope]) / sigma[:, None]
    covariance = np.linalg.inv(design.T @ design)
    _, size, delayed = covariance @ design.T @ (movement.value_mm[use] / sigma)
    shift = float(delayed / size)
    sigmas = np.sqrt(np.diagonal(covariance))
    return shift, float(sigmas[2] / size), float(size), float(sigmas[1])
