"""Drift check: detection of camera or mirror movement since calibration, from the targets' parallax.

If the rig has moved, the parallax changes smoothly over the picture, as for a changed relative orientation of
two pictures. So a smooth pattern of five terms is fitted to the targets' medians over half a second, and
compared with the size expected from pointing, mirrors and calibration.

Four image coordinates determine three coordinates of a point; the remaining one is its *parallax*, the number
of frame lines by which the two images lie too high and too low across their epipolar lines: the only evidence
two views give on their calibration. Anything that moves the images along these lines, or both alike, looks
like a point at another position.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Rig, linearise, parameter_slopes
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Points

WINDOW = 25
"""Number of fields evaluated together: half a second."""
LEAST_FIELDS, LEAST_TARGETS = 5, 8
UNMODELLED_PX = 0.1
"""σ of one target's parallax from local mirror errors, and from pointing at a target at rest."""
LARGEST_PX = 5.0
"""Prior σ of a pattern's terms."""
DOUBTFUL_RATIO, DOUBTFUL_PX = 2.5, 0.15
MOVED_RATIO, MOVED_PX = 4.0, 0.25
"""Both limits of a verdict must be exceeded: what is significant but small does no harm."""
_TERMS = 5
_HALF_WIDTH_PX, _HALF_HEIGHT_PX = 100.0, 200.0
_TUKEY = 4.7
"""Tukey's biweight constant: 95 % efficient for normal errors."""
_ROUNDS = 4


class RigVerdict(StrEnum):
    """Agreement of the rig with its calibration."""

    FITS = "fits"
    CORRECTED = "corrected"
    """It has moved, and marks on the cup have shown by how much: that is taken off the images."""
    DOUBTFUL = "doubtful"
    MOVED = "moved"
    UNMATCHED = "unmatched"
    """Targets are seen in both views, but this calibration identifies almost none of them."""
    UNKNOWN = "unknown"


class MarkState(StrEnum):
    """State of the marks of a view."""

    AT_REST = "at_rest"
    CORRECTED = "corrected"
    MOVING = "moving"
    """Moved, and not at rest yet: the correction waits."""
    HIDDEN = "hidden"
    """Fewer than two marks are seen."""
    CONTRADICTORY = "contradictory"
    """They do not move as one: marks have come off, or are dirty."""
    UNKNOWN = "unknown"
    """There are no marks, too few of them, or not enough fields yet."""


class ViewMarks(NamedTuple):
    """Marks of one view, in short.

    Attributes:
        state: What they say.
        marks: Number of marks used.
        size_px: Root mean square over the view of the movement that is taken off; 0 if none is.
        sigma_px: Of its standard deviation.
    """

    state: MarkState
    marks: int
    size_px: float
    sigma_px: float


@dataclass(frozen=True, slots=True)
class RigFit:
    """Agreement of pictures and calibration.

    Attributes:
        verdict: Verdict in one word.
        shift_px: Root mean square of the smooth pattern over the targets: movement of the views against each
            other across the epipolar lines; NaN if unknown.
        sigma_px: Its expected size on a rig that has not moved.
        ratio: Root mean square of the pattern's terms in units of σ; 1 on a rig that has not moved.
        residual_px: (2, 2) root mean square of the image residuals: view, (x, y).
        targets: Number of targets used.
        fields: Number of fields used.
        marks: Of the left and the right view; None for a calibration that has learnt no marks.
    """

    verdict: RigVerdict
    shift_px: float
    sigma_px: float
    ratio: float
    residual_px: Array
    targets: int
    fields: int
    marks: tuple[ViewMarks, ViewMarks] | None = None

    def with_marks(self, marks: tuple[ViewMarks, ViewMarks] | None) -> "RigFit":
        """The same with what the marks show, which the targets' parallaxes alone do not."""
        if marks is None:
            return self
        verdict = self.verdict
        if verdict in (RigVerdict.FITS, RigVerdict.UNKNOWN):
            verdict = _verdict_of(marks, verdict)
        return replace(self, verdict=verdict, marks=marks)


_DOUBTFUL_STATES = (MarkState.MOVING, MarkState.CONTRADICTORY)
_FEW_MARKS = 2
MOST_CORRECTED_PX = 3.0
"""Beyond, what moves an image by the depth of its target no longer is small."""


def _verdict_of(marks: tuple[ViewMarks, ViewMarks], otherwise: RigVerdict) -> RigVerdict:
    """Verdict by the marks alone, where the parallaxes show nothing wrong."""
    states = [one.state for one in marks]
    largest_px = max(one.size_px for one in marks)
    if any(state in _DOUBTFUL_STATES for state in states) or largest_px > MOST_CORRECTED_PX:
        return RigVerdict.DOUBTFUL
    if largest_px > 0.0:
        # Two marks do not show that one of them has slid about the other: the targets' parallaxes do.
        of_two = any(one.size_px > 0.0 and one.marks <= _FEW_MARKS for one in marks)
        return RigVerdict.DOUBTFUL if of_two and otherwise is RigVerdict.UNKNOWN else RigVerdict.CORRECTED
    return RigVerdict.FITS if all(state is MarkState.AT_REST for state in states) else otherwise


class _Pattern(NamedTuple):
    shift_px: float
    sigma_px: float
    ratio: float


class DriftCheck:
    """Parallaxes of one object seen by one rig, over the last `WINDOW` fields."""

    def __init__(self, rig: Rig, model: ObjectModel) -> None:
        self._rig = rig
        self._model = model
        self._parallax_px = np.full((WINDOW, len(model)), np.nan)
        self._image_px = np.full((len(model), 2), np.nan)
        self._squares_px2 = np.full((WINDOW, 2, 2), np.nan)
        self._fields = 0

    def add(self, points: Points) -> None:
        """Add one field's points, possibly none; points without a position are ignored."""
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
        """Evaluate the fields added."""
        fields = min(self._fields, WINDOW)
        residual = _rms(self._squares_px2)
        seen = np.flatnonzero(np.isfinite(self._parallax_px).sum(axis=0) >= LEAST_FIELDS)
        if len(seen) < LEAST_TARGETS:
            return RigFit(RigVerdict.UNKNOWN, np.nan, np.nan, np.nan, residual, len(seen), fields)
        median, sigma = _medians(self._parallax_px[:, seen])
        pattern = self._pattern(seen, median, sigma)
        return RigFit(_verdict(pattern), *pattern, residual, len(seen), fields)

    def _pattern(self, seen: Indices, median_px: Array, sigma_px: Array) -> _Pattern:
        terms = _terms(self._image_px[seen])
        fitted, covariance = _fitted(terms, median_px, np.hypot(sigma_px, UNMODELLED_PX))
        xyz_mm = self._model.xyz_mm[seen]
        shares = np.linalg.lstsq(terms, parallax_of_calibration(self._rig, xyz_mm), rcond=None)[0]
        covariance = covariance + shares @ shares.T
        ratio = np.sqrt(fitted @ np.linalg.solve(covariance, fitted) / _TERMS)
        expected = np.sqrt(((terms @ covariance) * terms).sum(axis=1).mean())
        return _Pattern(_size(terms @ fitted), float(expected), float(ratio))


def _verdict(pattern: _Pattern) -> RigVerdict:
    if pattern.ratio > MOVED_RATIO and pattern.shift_px > MOVED_PX:
        return RigVerdict.MOVED
    doubtful = pattern.ratio > DOUBTFUL_RATIO and pattern.shift_px > DOUBTFUL_PX
    return RigVerdict.DOUBTFUL if doubtful else RigVerdict.FITS


def _medians(values: Array) -> tuple[Array, Array]:
    """Median of every column of (F, K) with gaps, and its σ from the median absolute deviation."""
    count = np.isfinite(values).sum(axis=0)
    median = _median(values, count)
    # Of normal errors σ is 1.4826 median deviations, and a median scatters √(π/2) = 1.2533 times a mean.
    spread = 1.4826 * _median(np.abs(values - median), count)
    return median, 1.2533 * spread / np.sqrt(count)


def _median(values: Array, count: Indices) -> Array:
    """Median of the `count` numbers in every column; sorting puts NaN last."""
    return np.sort(values, axis=0)[count // 2, np.arange(values.shape[1])]


def _terms(image_px: Array) -> Array:
    """(K, 5) terms at positions in the left view: effect of a changed relative orientation on the
    parallax.
    """
    # Scaled to about 1 over a half picture, so that one prior suits all terms.
    x, y = ((image_px - image_px.mean(axis=0)) / (_HALF_WIDTH_PX, _HALF_HEIGHT_PX)).T
    return np.column_stack([np.ones_like(x), x, y, x * y, y * y])


def _fitted(terms: Array, values: Array, sigma: Array) -> tuple[Array, Array]:
    """Coefficients and their covariance, by least squares with Tukey's weights against outliers."""
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
    return np.clip(1.0 - (off / _TUKEY) ** 2, 0.0, None) ** 2


def _size(values: Array) -> float:
    return float(np.sqrt((values * values).mean()))


def _rms(squares: Array) -> Array:
    known = squares[np.isfinite(squares[:, 0, 0])]
    return np.sqrt(known.mean(axis=0)) if len(known) else np.full((2, 2), np.nan)


def parallax(rig: Rig, points: Points) -> tuple[Array, Array]:
    """Compute the parallax and image residuals of N points.

    To first order, the position of the point along its rays does not matter.

    Returns:
        (N,) parallax in frame lines, positive if the left image lies too low relative to the right one; and
        (N, 2, 2) observed minus computed image in px: point, view, (x, y).
    """
    computed, slopes = linearise(rig, points.xyz_mm)
    residual = points.image_px.transpose(2, 1, 0) - computed
    return (_across(slopes) * residual).sum(axis=(0, 1)), residual.transpose(2, 1, 0)


def parallax_of_calibration(rig: Rig, xyz_mm: Array) -> Array:
    """(N, K) change of the parallax of points (N, 3) by 1 σ of K independent calibration errors."""
    if rig.factor is None:
        return np.zeros((len(xyz_mm), 0))
    across = _across(linearise(rig, xyz_mm)[1])
    moved = rig.factor.swapaxes(1, 2) @ parameter_slopes(rig, xyz_mm)
    return (across[:, :, np.newaxis] * moved).sum(axis=(0, 1)).T


def _across(slopes: Array) -> Array:
    """(2, 2, N) weight of every image coordinate in the parallax, which no movement of the point changes.

    Args:
        slopes: (2, 2, 3, N) derivatives of the image coordinates by X, Y, Z: coordinate, view.
    """
    rows = slopes.transpose(3, 0, 1, 2).reshape(-1, 4, 3)
    of_three = -np.linalg.solve(rows[:, :3].swapaxes(1, 2), rows[:, 3, :, np.newaxis])[:, :, 0]
    whole = np.concatenate([of_three, np.ones((len(rows), 1))], axis=1)
    scaled = whole * (2.0 / (whole[:, 2] - whole[:, 3]))[:, np.newaxis]
    return scaled.T.reshape(2, 2, -1)
