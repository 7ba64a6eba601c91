"""Line shifts: the shift of each field line, common to all blobs of both views, solved for jointly.

The middle of blob i on field line k is c_ik = x_i + (a_i + t_i β) Δy + s_k + noise, with one shift s_k ~ N(0,
σj²) a line and the lean a_i + t_i β of a tilted disc, whose second part varies slowly over either half of the
picture, a quadratic in its place t_i. x_i and a_i are eliminated, which leaves normal equations in the shifts
whose bandwidth is the height of a blob, bordered by those in β. σj maximises the likelihood of the data. A
shift common to all lines of a group of blobs moves them alike and cannot be observed: its variance remains.

Row shifts: at 1 bit, each line's shift from how its rows' middles differ from those of their discs.

The middle of row r of disc i is x_i + s_r + noise, made upright by the lean of discs at such places. Of a
delivered row s_r is its line's shift, of an interpolated one the mean of both beside it. x_i is taken from
the mean of the disc's rows; the most likely shifts then solve a tridiagonal system. That is one turn of
maximising over discs and shifts alternately. Further turns gain nothing: what moves whole discs is unknown.
"""

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.field import PackedField
from grabberd.core.measurement.labelling import short
from grabberd.core.measurement.locale_table import moments_of, sizes_of
from grabberd.core.measurement.locators.locator import Chords, Located, Seen, lines_of


def band_of(row: NDArray[np.int64], column: NDArray[np.int64], value: Array, shape: tuple[int, int]) -> Array:
    """Sum elements into a symmetric band matrix (h, count), its diagonals from the main one down.

    Args:
        row: Row of each element.
        column: Column of each element, at most h − 1 less than its row.
        value: The elements, of the same shape.
        shape: h and the number of equations.
    """
    height, count = shape
    flat = (row - column) * count + column
    return np.bincount(flat.ravel(), value.ravel(), height * count).reshape(shape).astype(np.float64)


def band_factor(band: Array, more: float) -> Array:
    """(h, count) lower Cholesky factor of a band with `more` added to its main diagonal."""
    own = band.copy(order="F")
    own[0] += more
    return _lapack().dpbtrf(own, lower=1, overwrite_ab=1)[0]


def band_solve(lower: Array, right: Array) -> Array:
    """Solve for right sides (count,) or (count, M), given the Cholesky factor."""
    return _lapack().dpbtrs(lower, right, lower=1)[0]


def band_half_solve(lower: Array, right: Array) -> Array:
    """Apply L⁻¹ to right sides (count, M): products of the results are quadratic forms of the inverse."""
    return _lapack().dtbtrs(lower, right, uplo="L")[0]


def _lapack() -> Any:
    from scipy.linalg import lapack  # noqa: PLC0415 - 20 MB with what it loads, and the kernel needs none

    return lapack


ANY_LEAN = 0.5
"""Standard deviation of leans, columns per frame line, before anything is known of them, and of their
coefficients: wide enough to draw no disc upright."""
ENOUGH = 12
"""Fewest discs in a half for a quadratic in their places, which has six terms."""
RIDGE = 0.01
"""Added to the diagonal of the normal equations: places in a straight line do not determine all terms."""


def terms_of(column: Array, line: Array, size: tuple[int, int]) -> Array:
    """(N, K) terms of both halves' quadratics at the places of N discs; 0 in a half with few discs.

    Args:
        column: (N,) float64, columns of the discs' centres.
        line: (N,) float64, their field lines.
        size: Lines and columns of the field.
    """
    lines, columns = size
    right = column >= columns / 2
    u = 4.0 * column / columns - np.where(right, 3.0, 1.0)
    v = 2.0 * line / lines - 1.0
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    halves = [np.where(half[:, np.newaxis] & (half.sum() >= ENOUGH), terms, 0.0) for half in (~right, right)]
    return np.concatenate(halves, axis=1)


def smoothed(lean: Array, terms: Array) -> Array:
    """(N,) leans of discs at such places, from those found (N,)."""
    normal = terms.T @ terms + RIDGE * np.eye(terms.shape[1])
    return terms @ np.linalg.solve(normal, terms.T @ lean)


class Left(NamedTuple):
    """Rest of the leans' equations after eliminating the shifts, whose band matrix is L·Lᵀ.

    Attributes:
        half: (L, K) L⁻¹ of what ties the leans to the shifts.
        root: (K, K) lower Cholesky factor of the rest.
        rest: (K,) its solution downwards.
    """

    half: Array
    root: Array
    rest: Array

    def solution(self) -> Array:
        """(K,) most likely coefficients."""
        return _solve_lower(self.root, self.rest, trans=1)

    def half_solve(self, halves: Array) -> Array:
        """(K, M) what the leans' errors add to right sides of which L⁻¹ (L, M) is given, as that does."""
        return _solve_lower(self.root, self.half.T @ halves)


class Leans(NamedTuple):
    """K coefficients as unknowns beside L shifts: their part of the normal equations.

    Attributes:
        shifts: (L, K) against the shifts.
        own: (K, K) against each other, prior included.
        right: (K,) right side.
    """

    shifts: Array
    own: Array
    right: Array

    @classmethod
    def of(
        cls, terms: Array, at: NDArray[np.int64], steep: Array, beside: Array, centre: Array, count: int
    ) -> "Leans":
        """Make them from N discs with h chords.

        Args:
            terms: (N, K) terms of the discs' places.
            at: (N, h) equation of each chord.
            steep: (N, h) weighted Δy of each, less what the disc's own unknowns take up of it.
            beside: (N, h) Δy.
            centre: (N, h) middles of the chords.
            count: Number of shifts.
        """
        size = terms.shape[1]
        cell = at[:, :, np.newaxis] * size + np.arange(size)
        each = steep[:, :, np.newaxis] * terms[:, np.newaxis]
        shifts = np.bincount(cell.ravel(), each.ravel(), count * size).reshape(count, size)
        own = (terms.T * (steep * beside).sum(axis=1)) @ terms + np.eye(size) / ANY_LEAN**2
        return cls(shifts.astype(np.float64), own, terms.T @ (steep * centre).sum(axis=1))

    def left(self, lower: Array, right: Array) -> Left:
        """Eliminate the shifts, given their band's Cholesky factor and right side (L,)."""
        half = band_half_solve(lower, self.shifts)
        root: Array = np.asarray(np.linalg.cholesky(self.own - half.T @ half), np.float64)
        rest: Array = _solve_lower(root, self.right - half.T @ band_half_solve(lower, right))
        return Left(half, root, rest)


def _solve_lower(lower: Array, right: Array, trans: Literal[0, 1] = 0) -> Array:
    """Solve for right sides, given a lower triangle, or its transpose if `trans` is 1."""
    from scipy.linalg import solve_triangular  # noqa: PLC0415 - see `bands`

    return solve_triangular(lower, right, lower=True, trans=trans)


LINES_APART = 2
"""Frame lines from one field line to the next, whatever the rows are: only lines of analog fields shift."""
LEAN = 0.03
"""Least standard deviation of a_i about the leans of discs at such places, otherwise the root mean square of
what is seen of that."""
TRIED = np.exp2(np.arange(-4.0, 3.0))
"""Multiples of the expected line jitter whose likelihood is computed first; `REFINED`: of the best of
these."""
REFINED = np.exp2(np.arange(-2.0, 3.0) / 4.0)
UNSURE = 2.0
"""Prior standard deviation of the logarithm of the expected line jitter."""
OUTLYING = 4.0
"""Residual in standard deviations beyond which a chord is weighted down."""
TINY = float(np.finfo(np.float64).tiny)
ASKED_BESIDE = 8
"""Blobs between those for which the reach of the common error is evaluated."""


class LineShifts(NamedTuple):
    """Effect of the line shifts on the x of N blobs.

    Attributes:
        x_px: (N,) float64, error of each x, to be subtracted.
        common_px: (N,) float64, standard deviation of the rest, common to all blobs on the same lines.
        common_reach_px: Distance in frame lines over which its correlation falls to e^−½.
        line_jitter_px: σj as estimated.
    """

    x_px: Array
    common_px: Array
    common_reach_px: float
    line_jitter_px: float


def line_shifts(
    chords: Chords, centre: Array, size: tuple[int, int], expected_px: float, *, known: bool = False
) -> LineShifts:
    """Solve for the shifts of a field's lines.

    Args:
        chords: Chords of N blobs of both views, at least one.
        centre: (N,) float64, field line of each blob's centre, fractions included.
        size: Lines and columns of the field.
        expected_px: Line jitter expected; a weak prior beside the data.
        known: True if the line jitter is known and not to be estimated.
    """
    column = _surest(chords)
    chords = chords._replace(centre=chords.centre - column)
    terms = terms_of(column[:, 0], centre, size)
    first = _System.of(chords, centre, size[0], ANY_LEAN)
    residual, lean = first.residuals(expected_px)
    smooth = smoothed(lean, terms)
    # Outliers bend the shifts of whole lines.
    trusted = chords._replace(
        weight=chords.weight * _trust(residual), centre=chords.centre - smooth[:, np.newaxis] * first.beside
    )
    spread = float(np.sqrt(np.mean((lean - smooth) ** 2)))
    system = _System.of(trusted, centre, size[0], max(spread, LEAN), terms)
    jitter_px = expected_px if known else system.likeliest_px(expected_px)
    common, beside = system.common_variance(jitter_px)
    x_px = (chords.share * system.shifts(jitter_px)[system.at]).sum(axis=1)
    return LineShifts(x_px, np.sqrt(common), _reach_px(common[::ASKED_BESIDE], beside), jitter_px)


def _surest(chords: Chords) -> Array:
    """(N, 1) middle of each blob's best chord: relative to it numbers are small and round less."""
    return np.take_along_axis(chords.centre, chords.weight.argmax(axis=1)[:, np.newaxis], axis=1)


def unsolved(share: Array, jitter_px: float) -> LineShifts:
    """Expected effect of line jitter on x if the shifts are not solved for; `share` as in `Chords`."""
    common = jitter_px**2 * (share * share).sum(axis=1)
    beside = jitter_px**2 * (share[:, 1:] * share[:, :-1]).sum(axis=1)
    return LineShifts(np.zeros(len(common)), np.sqrt(common), _reach_px(common, beside), jitter_px)


def _reach_px(common: Array, beside: Array) -> float:
    """Reach of the error, from its variance and its covariance with that of a blob one line further down."""
    correlation = float(np.median(beside / np.maximum(common, TINY)))
    # Kept inside (0, 1), where the logarithm is finite and below 0.
    return LINES_APART / math.sqrt(-2.0 * math.log(min(max(correlation, 0.05), 0.99)))


def _trust(residual: Array) -> Array:
    """Factors for the weights of chords, by their residuals in units of σ."""
    return (OUTLYING / np.maximum(np.abs(residual), OUTLYING)) ** 2


class _System(NamedTuple):
    """Normal equations in the shifts of the L lines that touch a blob.

    Attributes:
        chords: Chords of N blobs.
        at: (N, h) int64, equation of each chord.
        beside: (N, h) float64, Δy of each chord, frame lines.
        solver: (N, 2, h), yields x and lean from the chords' middles.
        band: (h, L) normal matrix without σj, its diagonals from the main one down.
        right: (L,) right side.
        leans: Leans by place, if they are unknowns too.
    """

    chords: Chords
    at: NDArray[np.int64]
    beside: Array
    solver: Array
    band: Array
    right: Array
    leans: Leans | None = None

    @classmethod
    def of(
        cls, chords: Chords, centre: Array, lines: int, lean: float, terms: Array | None = None
    ) -> "_System":
        line = chords.line[:, np.newaxis] + np.arange(chords.centre.shape[1])
        beside = LINES_APART * (line - centre[:, np.newaxis])
        line = line.clip(0, lines - 1)
        touched = np.bincount(line.ravel(), ((chords.weight > 0) | (chords.share > 0)).ravel(), lines) > 0
        count = int(touched.sum())
        at = (np.cumsum(touched) - 1)[line].clip(0)
        solver = _solver(chords.weight, beside, lean)
        row, column = np.tril_indices(line.shape[1])
        explained = solver[:, 0, column] + beside[:, row] * solver[:, 1, column]
        matrix = chords.weight[:, row] * ((row == column) - explained)
        x, lean_of = (solver @ chords.centre[:, :, np.newaxis]).transpose(1, 0, 2)
        weighted = chords.weight * (chords.centre - x - beside * lean_of)
        right: Array = np.bincount(at.ravel(), weighted.ravel(), count).astype(np.float64)
        band = band_of(at[:, row], at[:, column], matrix, (line.shape[1], count))
        system = cls(chords, at, beside, solver, band, right)
        return system if terms is None else system._replace(leans=system._bordering(terms))

    def _bordering(self, terms: Array) -> Leans:
        """Leans by place as unknowns beside the shifts."""
        x, lean = (self.solver @ self.beside[:, :, np.newaxis]).transpose(1, 0, 2)
        steep = self.chords.weight * (self.beside - x - lean * self.beside)
        return Leans.of(terms, self.at, steep, self.beside, self.chords.centre, len(self.right))

    def likeliest_px(self, expected_px: float) -> float:
        """Find the most likely jitter among a few values, then among a few around the best."""
        tried_px = expected_px * TRIED
        # Leans by place are taken as they were found until then: these values are octaves apart.
        roughly = self._replace(leans=None).log_likelihoods(tried_px, expected_px)
        roughly_px = tried_px[np.argmax(roughly)]
        tried_px = roughly_px * REFINED
        return _peak(tried_px, self.log_likelihoods(tried_px, expected_px))

    def log_likelihoods(self, tried_px: Array, expected_px: float) -> list[float]:
        """Log likelihood of each jitter, with x, lean and shifts integrated out, plus its log prior."""
        return [
            self._log_likelihood(one) - 0.5 * (np.log(one / expected_px) / UNSURE) ** 2
            for one in tried_px.tolist()
        ]

    def shifts(self, jitter_px: float) -> Array:
        """(L,) most likely shifts."""
        lower = band_factor(self.band, jitter_px**-2)
        right = self.right
        if self.leans is not None:
            right = right - self.leans.shifts @ self.leans.left(lower, right).solution()
        return band_solve(lower, right)

    def common_variance(self, jitter_px: float) -> tuple[Array, Array]:
        """(N,) variance of x from errors of the shifts; for some, its covariance with x one line down."""
        some = slice(None, None, ASKED_BESIDE)
        # Solved for every blob; the kernel reads it from the inverse's band alone (docs/decisions).
        both = np.concatenate([self.at, np.minimum(self.at[some] + 1, len(self.right) - 1)])
        share = np.concatenate([self.chords.share, self.chords.share[some]])
        flat = np.arange(len(both))[:, np.newaxis] * len(self.right) + both
        shares = np.bincount(flat.ravel(), share.ravel(), len(both) * len(self.right)).astype(np.float64)
        lower = band_factor(self.band, jitter_px**-2)
        halves = band_half_solve(lower, shares.reshape(len(both), -1).T).T
        if self.leans is not None:
            by_leans = self.leans.left(lower, self.right).half_solve(halves.T)
            halves = np.concatenate([halves, by_leans.T], axis=1)
        own, below = halves[: len(self.at)], halves[len(self.at) :]
        return (own * own).sum(axis=1), (own[some] * below).sum(axis=1)

    def residuals(self, jitter_px: float) -> tuple[Array, Array]:
        """(N, h) residuals of the chords in units of σ, 0 where there is none; and the blobs' leans (N,)."""
        straight = self.chords.centre - self.shifts(jitter_px)[self.at]
        x, lean = (self.solver @ straight[:, :, np.newaxis]).transpose(1, 0, 2)
        return (straight - x - lean * self.beside) * np.sqrt(self.chords.weight), lean[:, 0]

    def _log_likelihood(self, jitter_px: float) -> float:
        lower = band_factor(self.band, jitter_px**-2)
        fit = float(self.right @ band_solve(lower, self.right))
        logs = float(np.log(lower[0]).sum() + len(self.right) * np.log(jitter_px))
        if self.leans is not None:
            left = self.leans.left(lower, self.right)
            fit, logs = fit + float(left.rest @ left.rest), logs + float(np.log(np.diag(left.root)).sum())
        return 0.5 * fit - logs


def _solver(weight: Array, beside: Array, lean: float) -> Array:
    """(N, 2, h) least-squares solvers for a straight line of slope near 0; zero where all weights are."""
    tilted = weight * beside
    a, b, c = weight.sum(axis=1), tilted.sum(axis=1), (tilted * beside).sum(axis=1) + lean**-2
    scale = 1.0 / np.maximum(a * c - b * b, TINY)
    x = c[:, np.newaxis] * weight - b[:, np.newaxis] * tilted
    lean = a[:, np.newaxis] * tilted - b[:, np.newaxis] * weight
    return np.stack([x, lean], axis=1) * scale[:, np.newaxis, np.newaxis]


def _peak(tried: Array, value: list[float]) -> float:
    """Peak of a parabola in log(tried), equally spaced, through the greatest value and its neighbours."""
    best = min(max(int(np.argmax(value)), 1), len(value) - 2)
    before, here, after = value[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    if bend >= 0:
        return float(tried[int(np.argmax(value))])
    steps = min(max(0.5 * (before - after) / bend, -1.0), 1.0)
    return float(tried[best] * (tried[1] / tried[0]) ** steps)


Whole = NDArray[np.int64]

MIDDLE_PX2 = 1 / 24
"""Variance of a row's middle: half the difference of two ends, each rounded to whole pixels."""
FURTHEST_PX = 0.75
"""Greatest difference of a row's middle that counts: rounding explains half a pixel, more is no disc."""


class Rows(NamedTuple):
    """R rows of M blobs, blob by blob; a gap between two runs of a row is taken as set: no target has such.

    Attributes:
        of: (R,) int64, number of the blob.
        row: (R,) int64, row of the packed field.
        first: (R,) int64, its first pixel.
        last: (R,) int64, its last pixel.
    """

    of: Whole
    row: Whole
    first: Whole
    last: Whole

    @classmethod
    def among(cls, seen: Seen, blob: Whole) -> "Rows":
        """The rows of some components (M,), which are numbered in this order."""
        number = np.full(len(seen.shapes), len(blob))
        number[blob] = np.arange(len(blob))
        of_run = number[seen.label]
        run = short(of_run, len(blob) + 1).argsort(kind="stable")[: np.count_nonzero(of_run < len(blob))]
        of, row, first, last = of_run[run], seen.runs.row[run], seen.runs.first[run], seen.runs.last[run]
        same = (of[1:] == of[:-1]) & (row[1:] == row[:-1])
        if same.any():
            new = np.flatnonzero(np.append(True, ~same))
            of, row, first, last = of[new], row[new], first[new], last[np.append(new[1:] - 1, -1)]
        return cls(of, row, first, last)


def steady_centres(seen: Seen, located: Located) -> Array:
    """(N, 2) columns and rows of all components of a field of 1 bit, without the shifts of its lines, unless
    the settings forbid it.
    """
    blob = np.flatnonzero(seen.whole if located.discs is None else located.discs)
    centres, centroids = located.centres.copy(), seen.centroids
    if seen.settings.line_shifts is not False and len(blob):
        moments = moments_of(seen.packed, seen.runs, seen.label, centroids)
        lean = sizes_of(moments, seen.whole, centroids, seen.packed).lean[blob]
        rows, jitter_px = Rows.among(seen, blob), seen.settings.line_jitter_px
        centres[blob, 0] -= moved_by_shifts(rows, seen.packed, centroids[blob], lean, jitter_px)
    return centres


def moved_by_shifts(rows: Rows, packed: PackedField, centres: Array, lean: Array, jitter_px: float) -> Array:
    """(M,) how far the shifts of lines have moved M blobs, columns.

    Args:
        rows: Their rows.
        packed: The field, of an analog camera.
        centres: (M, 2) float64, their centroids, columns and rows.
        lean: (M,) float64, columns per frame line.
        jitter_px: Expected standard deviation of a line's shift.
    """
    of, count = rows.of, len(centres)
    upright = lean[of] * packed.y_step * (rows.row - centres[of, 1])
    middle = (rows.first + rows.last) / 2 - upright
    mean = np.bincount(of, middle, count) / np.bincount(of, minlength=count)
    off = (middle - mean[of]).clip(-FURTHEST_PX, FURTHEST_PX)
    half = (rows.row * packed.y_step - packed.first_delivered).clip(0, 2 * lines_of(packed) - 2)
    shift = _shifts(half, off, lines_of(packed), MIDDLE_PX2 / jitter_px**2)[half]
    length = rows.last - rows.first + 1.0
    return np.bincount(of, length * shift, count) / np.bincount(of, length, count)


def _shifts(half: Whole, off: Array, lines: int, prior: float) -> Array:
    """(2 lines,) most likely shifts of lines and of what lies between one and the next: their mean."""
    (own, between), (off_own, off_between) = (
        np.bincount(half, weight, 2 * lines).astype(np.float64).reshape(lines, 2).T
        for weight in (np.ones(len(half)), off)
    )
    band: Array = np.stack([own + 0.25 * (between + _before(between)), 0.25 * between])
    right = off_own + 0.5 * (off_between + _before(off_between))
    shift = band_solve(band_factor(band, prior), right)
    return np.stack([shift, (shift + np.append(shift[1:], 0.0)) / 2], axis=1).ravel()


def _before(values: Array) -> Array:
    return np.append(0.0, values[:-1])
