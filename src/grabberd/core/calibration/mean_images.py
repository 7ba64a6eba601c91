"""Mean images of targets at rest throughout a capture, with realistic weights (paper 3.6), and whether all
rested.

Averaging divides noise by √n, but not the error that is locked to the pixels: a target at rest has the same
one in every field of a parity. Fields of the other parity cut the target at other lines: part of the error
has the opposite sign there, and goes; part is common to both, and stays. The opposite part shows in how far
the parities' means differ, beyond their noise. The common part shows nowhere, but is a multiple of it.
Predicted errors of single fields cannot tell either, since what scatters of them, up to all, is dither. A
stand that sinks or trembles by a few tenths of a pixel passes for still target by target; all targets
together show it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.calibration.adjustment.network import matched
from grabberd.errors import MeasurementError

_COMMON = {False: np.array([1.0, 0.6]), True: np.array([3.0, 0.33])}
"""Common variance in x and y as a multiple of the opposite one, of intact lines and of doubled ones.

From drawn discs of 1 to 2 mm, noise of .6 to 5 % and line jitter of .03 to .25 px: 0.8 to 1.3 and 0.2 to 1.0;
2.2 to 5 and 0.25 to 0.6. In x each parity's lines cut other chords; half of the doubled ones are made of the
same. In y the error repeats with the lines' distance, of which the parities are half a period apart.
"""
_OUTLIER = 35.0
"""Square of a difference, as a multiple of the median square, that does not belong to the others: 4 σ."""
_LEAST_PAIRS = 8
"""Targets that both parities must show, so that their difference is taken for that of all."""
_FIELD_ORDER_GATE_PX = 3.5
"""Gate for pairing targets of both parities: a wrong field order shifts them by two frame lines."""


@dataclass(frozen=True, slots=True, eq=False)
class FieldImages:
    """The N blobs of one field.

    Attributes:
        xy_px: (N, 2) frame pixels.
        sigma_px: (N, 2) standard deviation of location in one field, without line jitter.
        parity: Parity of the field.
        jitter_px: (N,) standard deviation in x from line jitter.
        area_px: (N,) size in square frame pixels; None if not known.
        is_doubled: True if every other line was interpolated.
    """

    xy_px: Array
    sigma_px: Array
    parity: int
    jitter_px: Array | float = 0.0
    area_px: Array | None = None
    is_doubled: bool = False

    @property
    def jitter_px2(self) -> Array:
        """(N, 2) variance from line jitter, zero in y."""
        return np.multiply.outer(np.square(self.jitter_px) * np.ones(len(self.xy_px)), (1.0, 0.0))


@dataclass(frozen=True, slots=True)
class MeansSettings:
    """Criteria for being at rest.

    Attributes:
        gate_px: Distance within which blobs of two fields belong to one target.
        least_share: Least share of the fields of a parity in which a target must be found.
        most_shift_px: Greatest shift of a whole field against the others.
        most_gone: Greatest share of the targets that a field may fail to show.
    """

    gate_px: float = 1.5
    least_share: float = 0.6
    most_shift_px: float = 0.5
    most_gone: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class MeanImages:
    """Means of N targets, in the order in which they were first seen.

    Attributes:
        xy_px: (N, 2) mean frame pixels.
        sigma_px: (N, 2) their standard deviations: of the noise left, and of the error locked to the pixels.
        fields: (N,) number of fields in which each was found.
        scatter_px: (N, 2) s, standard deviation of one field about its parity's mean; NaN if no parity has
            two fields.
        of_fields: Total number of fields.
        dropped: Number of blobs in all fields that belong to none of the targets.
    """

    xy_px: Array
    sigma_px: Array
    fields: Indices
    scatter_px: Array
    of_fields: int
    dropped: int

    def __len__(self) -> int:
        return len(self.xy_px)


class _Sums(NamedTuple):
    """Running sums of the clusters of one parity.

    Attributes:
        fields: (N,) number of fields.
        xy_px: (N, 2) mean.
        square_px2: (N, 2) Σ (x − mean)².
        variance_px2: (N, 2) mean of the single fields' σ².
        jitter_px2: (N, 2) mean of the single fields' variance from line jitter.
    """

    fields: Indices
    xy_px: Array
    square_px2: Array
    variance_px2: Array
    jitter_px2: Array

    @classmethod
    def new(cls, count: int) -> "_Sums":
        """Make clusters without a field."""
        return cls(np.zeros(count, np.intp), *np.zeros((4, count, 2)))

    def joined(self, other: "_Sums") -> "_Sums":
        """Concatenate with others."""
        both: Any = (np.concatenate(pair) for pair in zip(self, other, strict=True))
        return _Sums(*both)

    def select(self, chosen: Mask | Indices) -> "_Sums":
        """Select some of them."""
        some: Any = (values[chosen] for values in self)
        return _Sums(*some)

    @property
    def noise_px2(self) -> Array:
        """(N, 2) variance of the mean by what scatters from field to field."""
        return self._noise_px2() / self.fields[:, np.newaxis]

    @property
    def unseen_px2(self) -> Array:
        """(N, 2) part of the expected variance that the scatter does not show, at most the location's."""
        return np.clip(self.variance_px2 + self.jitter_px2 - self._noise_px2(), 0.0, self.variance_px2)

    def _noise_px2(self) -> Array:
        """(N, 2) variance of one field: each target's own, as far as they differ more than by chance.

        If no target was found twice, the variance of line jitter.
        """
        freedom = self.fields - 1
        if not freedom.any():
            return self.jitter_px2
        common = self.square_px2.sum(axis=0) / freedom.sum()
        own = self.square_px2 / np.maximum(freedom, 1)[:, np.newaxis]
        # 2σ⁴/f is the variance of a variance estimated with f degrees of freedom.
        chance = 2 * common**2 / np.maximum(freedom, 1)[:, np.newaxis]
        real = np.maximum(own[freedom > 0].var(axis=0) - chance[freedom > 0].mean(axis=0), 0.0)
        share = np.where(freedom[:, np.newaxis] > 0, real / np.maximum(real + chance, 1e-30), 0.0)
        return common + share * (own - common)


def mean_images(fields: Sequence[FieldImages], settings: MeansSettings | None = None) -> MeanImages:
    """Average the positions of everything at rest in a capture.

    Args:
        fields: The blobs of each field, of one view or both, without those cut off by a border; a field may
            have none.
        settings: Criteria for being at rest.

    Raises:
        MeasurementError: The calibration frame moved, or the parities contradict each other (a wrong field
            order); the message says which, with values.
    """
    settings = settings or MeansSettings()
    parities = [
        _still([one for one in fields if one.parity == parity], parity, settings)
        for parity in sorted({one.parity for one in fields})
    ]
    _check_field_order(parities)
    return _joined(parities or [_Sums.new(0)], fields, settings)


def _still(fields: Sequence[FieldImages], parity: int, settings: MeansSettings) -> _Sums:
    """Clusters at rest in the fields of one parity."""
    sums = _Sums.new(0)
    for one in fields:
        sums = _added(sums, one, settings.gate_px)
    kept = sums.select(sums.fields >= settings.least_share * len(fields))
    for index, one in enumerate(fields):
        _check_field(kept, one, f"field {index} of parity {parity}", settings)
    return kept


def _added(sums: _Sums, field: FieldImages, gate_px: float) -> _Sums:
    """Add a field to the clusters by Welford's running mean; blobs seen for the first time become
    clusters.
    """
    cluster, blob = matched(sums.xy_px, field.xy_px, gate_px)
    new = np.setdiff1d(np.arange(len(field.xy_px)), blob)
    grown = sums.joined(_Sums.new(len(new)))
    cluster, blob = np.append(cluster, np.arange(len(sums.fields), len(grown.fields))), np.append(blob, new)
    grown.fields[cluster] += 1
    count = grown.fields[cluster, np.newaxis]
    off = field.xy_px[blob] - grown.xy_px[cluster]
    grown.xy_px[cluster] += off / count
    grown.square_px2[cluster] += off * off * (count - 1) / count
    grown.variance_px2[cluster] += (field.sigma_px[blob] ** 2 - grown.variance_px2[cluster]) / count
    grown.jitter_px2[cluster] += (field.jitter_px2[blob] - grown.jitter_px2[cluster]) / count
    return grown


def _check_field(kept: _Sums, field: FieldImages, name: str, settings: MeansSettings) -> None:
    """Check that a field shows the same targets as the others, at the same positions."""
    if not len(field.xy_px):
        return
    cluster, blob = matched(kept.xy_px, field.xy_px, settings.gate_px)
    hint = "keep calibration frame and rig still, and repeat the capture"
    gone = 1.0 - len(cluster) / max(len(kept.fields), 1)
    elsewhere = 1.0 - len(blob) / len(field.xy_px)
    if min(gone, elsewhere) > settings.most_gone or not len(kept.fields):
        raise MeasurementError(
            f"the calibration frame moved: {name} shows {len(field.xy_px)} blobs, of which {len(blob)} are "
            f"where {len(kept.fields)} targets stand in most fields",
            hint,
        )
    shift = np.median(field.xy_px[blob] - kept.xy_px[cluster], axis=0) if len(blob) else np.zeros(2)
    if np.abs(shift).max() > settings.most_shift_px:
        raise MeasurementError(
            f"the calibration frame moved: {name} is shifted by ({shift[0]:.2f}, {shift[1]:.2f}) px against "
            "the mean of all",
            hint,
        )


def _check_field_order(parities: Sequence[_Sums]) -> None:
    """Check that both parities show the targets at the same height."""
    if len(parities) < 2:
        return
    first, second = matched(parities[0].xy_px, parities[1].xy_px, _FIELD_ORDER_GATE_PX)
    lower = parities[1].xy_px[second, 1] - parities[0].xy_px[first, 1]
    if len(lower) and abs(float(np.median(lower))) > 1.0:
        raise MeasurementError(
            f"the fields of both parities lie {np.median(lower):.1f} frame lines apart: the field order "
            "is wrong",
            "reverse the device's field order; it must not change within a capture",
        )


def _joined(parities: Sequence[_Sums], fields: Sequence[FieldImages], settings: MeansSettings) -> MeanImages:
    """Combine both parities' means by their variances; targets seen in only one are kept as they are."""
    same = _same(parities, settings.gate_px)
    seen = same >= 0
    padded = [one.select(np.maximum(index, 0)) for one, index in zip(parities, same, strict=True)]
    count = np.where(seen, [one.fields for one in padded], 0)
    common = _COMMON[any(one.is_doubled for one in fields)]
    opposite = _opposite_px2(padded, seen, common)
    # With weights w that sum to 1 the opposite part leaves (Σ ±w)² = 2 Σ w² − 1 of itself.
    weight = np.array([1.0 / (one.noise_px2 + 2.0 * opposite) for one in padded]) * seen[:, :, np.newaxis]
    total = weight.sum(axis=0)
    square = np.array([one.square_px2 for one in padded]) * seen[:, :, np.newaxis]
    freedom = (count - seen).sum(axis=0)[:, np.newaxis]
    return MeanImages(
        xy_px=(weight * [one.xy_px for one in padded]).sum(axis=0) / total,
        sigma_px=np.sqrt(1.0 / total + (common - 1.0) * opposite),
        fields=count.sum(axis=0),
        scatter_px=np.sqrt(square.sum(axis=0) / np.where(freedom > 0, freedom, np.nan)),
        of_fields=len(fields),
        dropped=sum(len(one.xy_px) for one in fields) - int(count.sum()),
    )


def _opposite_px2(parities: Sequence[_Sums], seen: Mask, common: Array) -> Array:
    """(N, 2) variance of the error that has the opposite sign in the other parity.

    It is the same share of every target's expected variance: that by which the parities differ. Where they
    cannot be compared, everything that the scatter does not show counts as locked to the pixels.
    """
    expected = _mean_of([one.variance_px2 for one in parities], seen)
    both = seen.all(axis=0) & (np.array([one.fields for one in parities]).min(axis=0) > 1)
    if len(parities) < 2 or both.sum() < _LEAST_PAIRS:
        return _mean_of([one.unseen_px2 for one in parities], seen) / (1.0 + common)
    first, second = (one.select(both) for one in parities)
    apart = first.xy_px - second.xy_px
    square = (apart - np.median(apart, axis=0)) ** 2
    # A target that one parity does not show whole says nothing of the others.
    square[square > _OUTLIER * np.median(square, axis=0)] = np.nan
    locked = 0.25 * np.nanmean(square - first.noise_px2 - second.noise_px2, axis=0)
    share = locked / np.maximum(expected[both].mean(axis=0), 1e-30)
    return np.maximum(share, 0.0) * expected


def _mean_of(values: Sequence[Array], seen: Mask) -> Array:
    """(N, 2) mean over the parities that show each target."""
    shown = seen[:, :, np.newaxis]
    mean: Array = (np.array(values) * shown).sum(axis=0) / shown.sum(axis=0)
    return mean


def _same(parities: Sequence[_Sums], gate_px: float) -> Indices:
    """(P, N) index of each target in each parity; −1 if it does not show it."""
    first, *others = parities
    same, xy_px = np.arange(len(first.fields))[np.newaxis], first.xy_px
    for other in others:
        target, index = matched(xy_px, other.xy_px, gate_px)
        new = np.setdiff1d(np.arange(len(other.fields)), index)
        own = np.full(len(xy_px) + len(new), -1)
        own[target], own[len(xy_px) :] = index, new
        same = np.vstack([np.pad(same, ((0, 0), (0, len(new))), constant_values=-1), own])
        xy_px = np.concatenate([xy_px, other.xy_px[new]])
    return same


_GATE_PX = 1.5
_LEAST_IMAGES = 8


@dataclass(frozen=True, slots=True)
class Stillness:
    """Movement of one view's picture during the capture.

    Attributes:
        rms_px: Root mean square of the fields' common shifts, in x and y.
        drift_px: Their steady change from the first field to the last.
        drift_sigma_px: Its standard deviation, by how the shifts scatter about it; infinite if unknown.
    """

    rms_px: float
    drift_px: float
    drift_sigma_px: float


def stillness(fields: Sequence[FieldImages], means: MeanImages) -> Stillness:
    """Measure the movement of one view's picture; zero for fewer than three fields of a parity."""
    shifts = np.array([_shift(one, means) for one in fields]).reshape(-1, 2)
    parity = np.array([one.parity for one in fields])
    time = np.arange(len(fields), dtype=float)
    kept = np.isfinite(shifts).all(axis=1)
    for one in np.unique(parity):
        own = (parity == one) & kept
        # Each parity cuts the discs at other lines, which shifts all of them alike.
        if own.sum() < 3:
            kept &= ~own
        else:
            shifts[own] -= shifts[own].mean(axis=0)
    if not kept.any():
        return Stillness(0.0, 0.0, math.inf)
    slope, start = np.polyfit(time[kept], shifts[kept], 1)
    scatter = shifts[kept] - start - np.outer(time[kept], slope)
    away, span = time[kept] - time[kept].mean(), float(np.ptp(time[kept]))
    freedom = 2 * int(kept.sum()) - 4
    sigma = (
        math.sqrt(float((scatter**2).sum()) / freedom / float((away**2).sum())) if freedom > 0 else math.inf
    )
    rms = float(np.sqrt((shifts[kept] ** 2).sum(axis=1).mean()))
    return Stillness(rms, float(np.linalg.norm(slope)) * span, sigma * span)


def _shift(field: FieldImages, means: MeanImages) -> Array:
    """(2,) median displacement of a field's images from the means; NaN with too few of them."""
    between = np.linalg.norm(field.xy_px[:, np.newaxis] - means.xy_px, axis=2)
    if not between.size:
        return np.full(2, np.nan)
    nearest = between.argmin(axis=1)
    near = between[np.arange(len(nearest)), nearest] < _GATE_PX
    if near.sum() < _LEAST_IMAGES:
        return np.full(2, np.nan)
    return np.median(field.xy_px[near] - means.xy_px[nearest[near]], axis=0)
