"""Whether camera or mirrors have moved since the calibration: the parallax of all targets over some seconds.

A rig that has moved gives the targets parallaxes that change smoothly over the picture, as a changed relative
orientation of two pictures does. So a smooth pattern of five terms is fitted to the targets' medians, and is
held against what pointing, mirrors and calibration lead one to expect of it.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import Rig
from grabberd.reconstruction.accuracy.parallax import parallax, parallax_of_calibration
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.points import Points

Array = NDArray[np.float64]

WINDOW = 25
"""Fields that are looked at together."""
LEAST_FIELDS, LEAST_TARGETS = 5, 8
UNMODELLED_PX = 0.1
"""Of one target's parallax: local errors of the mirrors, and of pointing at a target at rest."""
LARGEST_PX = 5.0
"""A pattern's terms are of this size at most."""
DOUBTFUL_RATIO, DOUBTFUL_PX = 2.5, 0.15
MOVED_RATIO, MOVED_PX = 4.0, 0.25
"""Both are to be exceeded: what is significant but small harms nobody."""
_TERMS = 5
_HALF_WIDTH_PX, _HALF_HEIGHT_PX = 100.0, 200.0
_TUKEY = 4.7
_ROUNDS = 4


class RigVerdict(StrEnum):
    """Whether the rig still is as it was calibrated."""

    FITS = "fits"
    DOUBTFUL = "doubtful"
    MOVED = "moved"
    UNMATCHED = "unmatched"
    """Targets are seen in both views, but next to none of them is the object's by this calibration."""
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class RigFit:
    """How well pictures and calibration agree.

    Attributes:
        verdict: in a word.
        shift_px: root mean square of the smooth pattern over the targets: by how much the views have moved
            against each other, across the epipolar lines; NaN where it is unknown.
        sigma_px: what it is expected to be on a rig that has not moved.
        ratio: root mean square of the pattern's terms in units of their σ; 1 on a rig that has not moved.
        residual_px: (2, 2) root mean square of the images' residuals: view, (x, y).
        targets: that it rests on; `fields`: of these.
    """

    verdict: RigVerdict
    shift_px: float
    sigma_px: float
    ratio: float
    residual_px: Array
    targets: int
    fields: int


class _Pattern(NamedTuple):
    shift_px: float
    sigma_px: float
    ratio: float


class DriftCheck:
    """The last `WINDOW` fields' parallaxes of one object before one rig."""

    def __init__(self, rig: Rig, model: ObjectModel) -> None:
        self._rig = rig
        self._model = model
        self._parallax_px = np.full((WINDOW, len(model)), np.nan)
        self._image_px = np.full((len(model), 2), np.nan)
        self._squares_px2 = np.full((WINDOW, 2, 2), np.nan)
        self._fields = 0

    def add(self, points: Points) -> None:
        """Takes one field's points, of which there may be none; one without a place is left out."""
        known = points.select(np.flatnonzero(np.isfinite(points.xyz_mm).all(axis=1)))
        row = self._fields % WINDOW
        self._fields += 1
        self._parallax_px[row] = self._squares_px2[row] = np.nan
        if not len(known):
            return
        across, residual = parallax(self._rig, known)
        target = np.searchsorted(self._model.target, known.target)
        self._parallax_px[row, target] = across
        self._image_px[target] = known.image_px[:, 0]
        self._squares_px2[row] = (residual * residual).mean(axis=0)

    def fit(self) -> RigFit:
        """What these fields say."""
        fields = min(self._fields, WINDOW)
        residual = _rms(self._squares_px2)
        seen = np.flatnonzero(np.isfinite(self._parallax_px).sum(axis=0) >= LEAST_FIELDS)
        if len(seen) < LEAST_TARGETS:
            return RigFit(RigVerdict.UNKNOWN, np.nan, np.nan, np.nan, residual, len(seen), fields)
        median, sigma = _medians(self._parallax_px[:, seen])
        found = self._pattern(seen, median, sigma)
        return RigFit(_verdict(found), *found, residual, len(seen), fields)

    def _pattern(self, seen: NDArray[np.intp], median_px: Array, sigma_px: Array) -> _Pattern:
        terms = _terms(self._image_px[seen])
        fitted, covariance = _fitted(terms, median_px, np.hypot(sigma_px, UNMODELLED_PX))
        places = self._model.xyz_mm[seen]
        shares = np.linalg.lstsq(terms, parallax_of_calibration(self._rig, places), rcond=None)[0]
        covariance = covariance + shares @ shares.T
        ratio = np.sqrt(fitted @ np.linalg.solve(covariance, fitted) / _TERMS)
        expected = np.sqrt(((terms @ covariance) * terms).sum(axis=1).mean())
        return _Pattern(_size(terms @ fitted), float(expected), float(ratio))


def _verdict(found: _Pattern) -> RigVerdict:
    if found.ratio > MOVED_RATIO and found.shift_px > MOVED_PX:
        return RigVerdict.MOVED
    doubtful = found.ratio > DOUBTFUL_RATIO and found.shift_px > DOUBTFUL_PX
    return RigVerdict.DOUBTFUL if doubtful else RigVerdict.FITS


def _medians(values: Array) -> tuple[Array, Array]:
    """Of every column of (F, K) with gaps: its median, and that one's σ from the median deviation."""
    count = np.isfinite(values).sum(axis=0)
    median = _median(values, count)
    spread = 1.4826 * _median(np.abs(values - median), count)
    return median, 1.2533 * spread / np.sqrt(count)


def _median(values: Array, count: NDArray[np.intp]) -> Array:
    """Of the `count` numbers in every column; sorting puts what is none behind them."""
    middle: Array = np.sort(values, axis=0)[count // 2, np.arange(values.shape[1])]
    return middle


def _terms(image_px: Array) -> Array:
    """(K, 5) of places in the left view: what a changed relative orientation makes of the parallax."""
    x, y = ((image_px - image_px.mean(axis=0)) / (_HALF_WIDTH_PX, _HALF_HEIGHT_PX)).T
    return np.column_stack([np.ones_like(x), x, y, x * y, y * y])


def _fitted(terms: Array, values: Array, sigma: Array) -> tuple[Array, Array]:
    """Terms' sizes and their covariance, by weighted least squares without what lies far off (Tukey)."""
    offset = values - np.sort(values)[len(values) // 2]
    fitted: Array = np.zeros(_TERMS)
    normal: Array = np.eye(_TERMS)
    weight = _believed(offset / max(1.4826 * np.sort(np.abs(offset))[len(values) // 2], sigma.min()))
    for _ in range(_ROUNDS):
        normal = terms.T @ ((weight / sigma**2)[:, np.newaxis] * terms) + np.eye(_TERMS) / LARGEST_PX**2
        fitted = np.linalg.solve(normal, terms.T @ (weight / sigma**2 * values)).astype(np.float64)
        distance: Array = (values - terms @ fitted) / sigma
        weight = _believed(distance / max(1.4826 * np.sort(np.abs(distance))[len(distance) // 2], 1.0))
    covariance: Array = np.linalg.inv(normal).astype(np.float64)
    return fitted, covariance


def _believed(off: Array) -> Array:
    weight: Array = np.clip(1.0 - (off / _TUKEY) ** 2, 0.0, None) ** 2
    return weight


def _size(values: Array) -> float:
    return float(np.sqrt((values * values).mean()))


def _rms(squares: Array) -> Array:
    known = squares[np.isfinite(squares[:, 0, 0])]
    root: Array = np.sqrt(known.mean(axis=0)) if len(known) else np.full((2, 2), np.nan)
    return root
