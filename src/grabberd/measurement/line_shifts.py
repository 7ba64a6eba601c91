"""The shift that each field line has in common to all blobs of both views: line jitter, solved for.

The middle of blob i on field line k is c_ik = x_i + a_i Δy + s_k + noise, with one shift s_k ~ N(0, σj²) a line
and a small lean a_i of a tilted disc. x_i and a_i are eliminated, which leaves normal equations in the shifts
whose band is as wide as a blob is high. σj is where the data are most likely. What all lines of a group of
blobs have in common moves the blobs likewise and cannot be known: its variance stays.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locator import Chords

LEAN = 0.1
"""Standard deviation of a_i before the data are asked: columns a frame line."""
LINES_APART = 2.0
"""Frame lines from one field line to the next."""
TRIED = np.array([1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0, 4.0])
"""Shares of the expected line jitter that the data are asked about."""
REFINED = np.array([0.71, 0.84, 1.0, 1.19, 1.41])
UNSURE = 2.0
"""Standard deviation of the logarithm of the expected line jitter."""
MEDIAN_OF_SQUARES = 0.455
"""Of normally distributed numbers of variance 1; wild blobs do not move it."""
OUTLYING = 4.0
"""Chords more standard deviations away count as if they were less sure, so that they do no harm."""

Array = NDArray[np.float64]


class LineShifts(NamedTuple):
    """What the x of N blobs owes to the shifts of their lines.

    Attributes:
        x_px: (N,) float64, the error of each x, to be subtracted.
        common_px: (N,) float64, standard deviation of what remains, common to all blobs on the same lines.
        line_jitter_px: σj as estimated.
    """

    x_px: Array
    common_px: Array
    line_jitter_px: float


def line_shifts(chords: Chords, centre: Array, lines: int, expected_px: float) -> LineShifts:
    """The shifts of a field's lines.

    Args:
        chords: of N blobs of both views, one at least.
        centre: (N,) float64, the field line of each blob's centre, fractions included.
        lines: how many lines the field has.
        expected_px: the line jitter to expect; it counts for little beside the data.
    """
    first = _System.of(chords, centre, lines, LEAN)
    tried_px = expected_px * TRIED
    roughly_px = float(tried_px[np.argmax(first.log_likelihoods(tried_px, expected_px))])
    residual, lean = first.residuals(roughly_px)
    trusted = chords._replace(weight=chords.weight * _trust(residual))
    system = _System.of(trusted, centre, lines, lean)
    tried_px = roughly_px * REFINED
    jitter_px = _peak(tried_px, system.log_likelihoods(tried_px, expected_px))
    between = system.covariance(jitter_px)[system.at[:, :, np.newaxis], system.at[:, np.newaxis, :]]
    share = chords.share[:, np.newaxis, :]
    common = (share @ between @ share.swapaxes(1, 2))[:, 0, 0]
    x_px = (chords.share * system.shifts(jitter_px)[system.at]).sum(axis=1)
    return LineShifts(x_px, np.sqrt(common), jitter_px)


def unsolved_px(chords: Chords, jitter_px: float) -> Array:
    """(N,) standard deviation of x from line jitter while the shifts are not solved for."""
    common: Array = jitter_px * np.sqrt((chords.share**2).sum(axis=1))
    return common


def _trust(residual: Array) -> Array:
    """Factors for the weights of chords with these residuals in units of their σ."""
    trust: Array = (OUTLYING / np.maximum(np.abs(residual), OUTLYING)) ** 2
    return trust


class _System(NamedTuple):
    """The normal equations in the shifts of those L lines that touch a blob.

    Attributes:
        chords: N blobs' chords.
        at: (N, h) int64, the equation of each chord.
        beside: (N, h) float64, Δy of each chord, frame lines.
        lean: standard deviation of the blobs' leans.
        solver: (N, 2, h), gives x and lean from the chords' middles.
        band: (h, L) normal matrix without σj, its diagonals from the main one down; `right`: (L,).
    """

    chords: Chords
    at: NDArray[np.int64]
    beside: Array
    lean: float
    solver: Array
    band: Array
    right: Array

    @classmethod
    def of(cls, chords: Chords, centre: Array, lines: int, lean: float) -> "_System":
        line = chords.line[:, np.newaxis] + np.arange(chords.centre.shape[1])
        beside = LINES_APART * (line - centre[:, np.newaxis])
        touched = np.unique(line[(chords.weight > 0) | (chords.share > 0)])
        at = np.searchsorted(touched, line.clip(0, lines - 1)).clip(0, len(touched) - 1)
        solver = _solver(chords.weight, beside, lean)
        explained = solver[:, :1] + beside[:, :, np.newaxis] * solver[:, 1:]
        own = np.eye(line.shape[1]) - explained
        matrix = chords.weight[:, :, np.newaxis] * own
        right = np.bincount(at.ravel(), (matrix @ chords.centre[:, :, np.newaxis]).ravel(), len(touched))
        return cls(chords, at, beside, lean, solver, _banded(at, matrix, len(touched)), right)

    def log_likelihoods(self, tried_px: Array, expected_px: float) -> list[float]:
        """Of the data with x, lean and shifts integrated out, at each jitter; and of that if one is expected."""
        return [
            self._log_likelihood(one) - 0.5 * (np.log(one / expected_px) / UNSURE) ** 2
            for one in tried_px.tolist()
        ]

    def shifts(self, jitter_px: float) -> Array:
        """(L,) the likeliest shifts."""
        return _solve(self._factor(jitter_px), self.right)

    def covariance(self, jitter_px: float) -> Array:
        """(L, L) of the shifts' errors."""
        return _solve(self._factor(jitter_px), np.eye(len(self.right)))

    def residuals(self, jitter_px: float) -> tuple[Array, float]:
        """(N, h) of the chords, in units of their σ, 0 where there is none; and the σ of the blobs' leans."""
        straight = self.chords.centre - self.shifts(jitter_px)[self.at]
        x, lean = (self.solver @ straight[:, :, np.newaxis]).transpose(1, 0, 2)
        residual = (straight - x - lean * self.beside) * np.sqrt(self.chords.weight)
        unsure = self.lean**2 * (1.0 - (self.solver[:, 1] * self.beside).sum(axis=1))
        return residual, float(np.sqrt(np.median(lean**2) / MEDIAN_OF_SQUARES + unsure.mean()))

    def _log_likelihood(self, jitter_px: float) -> float:
        factor = self._factor(jitter_px)
        fit = float(self.right @ _solve(factor, self.right))
        return 0.5 * fit - float(np.log(factor[0]).sum() + len(self.right) * np.log(jitter_px))

    def _factor(self, jitter_px: float) -> Array:
        """(h, L) lower banded Cholesky factor of the normal matrix."""
        from scipy.linalg.lapack import dpbtrf

        band = self.band.copy(order="F")
        band[0] += jitter_px**-2
        factor: Array = dpbtrf(band, lower=1, overwrite_ab=1)[0]
        return factor


def _solver(weight: Array, beside: Array, lean: float) -> Array:
    """(N, 2, h) least squares for a straight line whose slope is near 0; nothing where nothing weighs."""
    tilted = weight * beside
    a, b, c = weight.sum(axis=1), tilted.sum(axis=1), (tilted * beside).sum(axis=1) + lean**-2
    scale = 1.0 / np.maximum(a * c - b * b, np.finfo(np.float64).tiny)
    x = c[:, np.newaxis] * weight - b[:, np.newaxis] * tilted
    lean = a[:, np.newaxis] * tilted - b[:, np.newaxis] * weight
    return np.stack([x, lean], axis=1) * scale[:, np.newaxis, np.newaxis]


def _banded(at: NDArray[np.int64], matrix: Array, count: int) -> Array:
    """(h, L) the sum of the blobs' (N, h, h) matrices, its diagonals from the main one down."""
    height = at.shape[1]
    below = at[:, :, np.newaxis] - at[:, np.newaxis, :]
    lower = below >= 0
    place = (below * count + at[:, np.newaxis, :])[lower]
    return np.bincount(place, matrix[lower], height * count).reshape(height, count)


def _solve(factor: Array, right: Array) -> Array:
    from scipy.linalg.lapack import dpbtrs

    solution: Array = dpbtrs(factor, right, lower=1)[0]
    return solution


def _peak(tried: Array, value: list[float]) -> float:
    """Where a parabola in log(tried) through the greatest value and its neighbours is greatest."""
    best = min(max(int(np.argmax(value)), 1), len(value) - 2)
    near = slice(best - 1, best + 2)
    x = np.log(tried[near])
    curvature, slope, _ = np.polyfit(x - x[1], value[near], 2).tolist()
    if curvature >= 0:
        return float(tried[int(np.argmax(value))])
    return float(np.exp(x[1] + np.clip(-slope / (2 * curvature), x[0] - x[1], x[2] - x[1])))
