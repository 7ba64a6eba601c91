"""A linear model with fixed coefficients and random effects, fitted by restricted maximum likelihood to
values of one quantity from several captures, each with its own σ and with what it shares with others.

The variance of the observations is θ₀ I + Σ θₖ Zₖ Zₖᵀ; in a balanced design an effect's may come out
negative, as in an analysis of variance: with few levels this keeps the tests honest, and gives exactly the
classical ones. σ and degrees of freedom are after Kenward and Roger, Biometrics 53 (1997) 983. What the
observations share is propagated through the same linear combination, as the GUM does, and never weighs them.
"""

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.special import stdtr, stdtrit

from grabberd.core.arrays import Array, Mask

Levels = NDArray[np.int64]


class Observations(NamedTuple):
    """N values of a quantity.

    Attributes:
        value: (N,) values.
        own: (N,) σ of each that is independent of all others; NaN where it is not known.
        shared: (N, S) σ of each by S causes that captures share. The errors by one cause go together in full,
            those by different causes are independent.
        unsplit: (N,) σ of each of which nobody knows how much is shared: `shared` has all of it, `own` none.
    """

    value: Array
    own: Array
    shared: Array
    unsplit: Array

    def taken(self, rows: Mask | Levels) -> "Observations":
        """Some of them."""
        return Observations(*(part[rows] for part in self))


def observations(value: Array, sigma: Array, common: Array, share: Sequence[Hashable]) -> Observations:
    """Values whose σ has a part in common with those of the same share.

    Args:
        value: (N,) values.
        sigma: (N,) the whole σ of each; NaN where it is not known.
        common: (N,) the part of it that the share has in common; NaN where it is not known.
        share: N names of shares: captures of one share err together.
    """
    levels = levels_of(share)
    known, whole = np.isfinite(common), np.nan_to_num(sigma)
    part = np.where(known, np.nan_to_num(common), whole)
    shared = np.zeros((len(levels), int(levels.max(initial=-1)) + 1))
    shared[np.arange(len(levels)), levels] = part
    own = np.sqrt(np.maximum(np.square(sigma) - np.square(part), 0.0))
    return Observations(np.asarray(value, np.float64), own, shared, np.where(known, 0.0, whole))


def levels_of(names: Sequence[Hashable]) -> Levels:
    """(N,) numbers from 0 for names, in the order in which they first appear."""
    seen: dict[Hashable, int] = {}
    return np.array([seen.setdefault(name, len(seen)) for name in names], dtype=np.int64)


def cell_means(observed: Observations, cell: Levels) -> Observations:
    """(C,) means of the observations of each cell; a mean shares what its observations share.

    Args:
        observed: N observations.
        cell: (N,) cell of each, from 0 to C - 1.
    """
    if int(cell.max(initial=-1)) + 1 == len(cell):
        return observed.taken(np.argsort(cell))
    member = (cell[None, :] == np.arange(cell.max(initial=-1) + 1)[:, None]).astype(np.float64)
    weights = member / member.sum(axis=1, keepdims=True)
    own, unsplit = (np.sqrt(np.square(weights) @ np.square(one)) for one in (observed.own, observed.unsplit))
    return Observations(weights @ observed.value, own, weights @ observed.shared, unsplit)


LEVEL = 0.95
"""Probability of the intervals."""


class Contrast(NamedTuple):
    """Combination of a model's coefficients.

    Attributes:
        value: what it is.
        sigma: one standard deviation, by the scatter of the observations and by what they share.
        common: part of `sigma` that is shared, which averaging over observations does not reduce.
        dof: degrees of freedom of `sigma` after Welch and Satterthwaite, `common` counting as known; NaN
            where there is no scatter to judge by: then `sigma` is that of the measurements alone.
        by_sigma: True if the measurements' own σ decides, since the scatter is smaller, or there is none.
    """

    value: float
    sigma: float
    common: float
    dof: float
    by_sigma: bool

    @property
    def t(self) -> float:
        """The value by its σ; NaN where nothing can be tested."""
        return self.value / self.sigma if np.isfinite(self.dof) and self.sigma > 0 else np.nan

    @property
    def p(self) -> float:
        """Probability of a value at least as far from 0, if it were 0; NaN where nothing can be tested."""
        return float(2.0 * stdtr(self.dof, -abs(self.t))) if np.isfinite(self.t) else np.nan

    @property
    def half_width(self) -> float:
        """Half the 95 % interval; NaN where nothing can be tested."""
        return float(stdtrit(self.dof, 0.5 + LEVEL / 2) * self.sigma) if np.isfinite(self.dof) else np.nan


def contrast(value: float, by_scatter: tuple[float, float], own: float, common: float) -> Contrast:
    """A contrast from the parts of its σ.

    Args:
        value: what it is.
        by_scatter: its variance by the scatter of the observations and the degrees of freedom of that; NaN
            where the observations have none to spare.
        own: its variance by the observations' own σ; NaN where that is not known.
        common: its σ by what they share.
    """
    scatter, dof = by_scatter
    by_sigma = not scatter >= own if np.isfinite(own) else not np.isfinite(scatter)
    independent = own if by_sigma else scatter
    variance = independent + common**2
    if by_sigma and not np.isfinite(scatter):
        return Contrast(value, float(np.sqrt(variance)), common, np.nan, True)
    # With the scatter's freedom even where σ decides: a small scatter is no proof that σ is right.
    total = np.inf if independent == 0 else dof * (variance / independent) ** 2
    return Contrast(value, float(np.sqrt(variance)), common, float(total), by_sigma)


_STEPS, _HALVINGS = 200, 40
_SETTLED, _SEEN = 1e-13, 1e-7
"""Gains of the logarithmic likelihood: that a step has to promise, and that its rounding lets be seen."""
_EQUAL = 1e-12
"""Departure from a model below which values are equal to it, by the greatest of them."""
_SINGULAR = 1e-9
"""Share of the residual variance below which a variance counts as none."""


class Fit(NamedTuple):
    """A fitted model of N observations with P coefficients.

    Attributes:
        coefficients: (P,) of the columns of the design.
        variances: (1 + K,) of the residual and of each effect; empty where nothing was left to estimate
            them by, zero where there is no scatter.
        weights: (P, N) of the observations in the coefficients.
        covariance: (P, P) of the coefficients, for a small sample.
        plain: (P, P) the same for a large one; its slopes (1 + K, P, P) by each variance.
        slopes: see there.
        variances_covariance: (1 + K, 1 + K) of the variances.
        observed: what was fitted.
    """

    coefficients: Array
    variances: Array
    weights: Array
    covariance: Array
    plain: Array
    slopes: Array
    variances_covariance: Array
    observed: Observations

    def contrast(self, of: Array, most_dof: float = np.inf) -> Contrast:
        """A combination of the coefficients.

        Args:
            of: (P,) the share of each.
            most_dof: degrees of freedom that the scatter has at most.
        """
        weights = of @ self.weights
        common = float(np.linalg.norm(weights @ self.observed.shared))
        own = float(np.square(weights) @ np.square(self.observed.own))
        # Of what nobody can split, the worse counts: that it is shared, or that it is not.
        own += max(float(np.square(weights) @ np.square(self.observed.unsplit)) - common**2, 0.0)
        scatter, dof = self._by_scatter(of)
        return contrast(float(of @ self.coefficients), (scatter, min(dof, most_dof)), own, common)

    def _by_scatter(self, of: Array) -> tuple[float, float]:
        if not len(self.variances):
            return np.nan, np.nan
        slope = np.einsum("p,kpq,q->k", of, self.slopes, of)
        spread = float(slope @ self.variances_covariance @ slope)
        plain = float(of @ self.plain @ of)
        # Where a variance is at its least value the adjustment can be negative, which it never should be.
        variance = max(float(of @ self.covariance @ of), plain)
        return variance, 2 * plain**2 / spread if spread > 0 else self._freedom

    @property
    def _freedom(self) -> float:
        return float(len(self.observed.value) - len(self.coefficients))


def fit(observed: Observations, design: Array, effects: Sequence[Levels] = ()) -> Fit:
    """Fit the model.

    Args:
        observed: N values.
        design: (N, P) of full rank.
        effects: levels (N,) of each random effect, which `identifiable` has found to be so.

    Raises:
        ValueError: the design is not of full rank.
    """
    count, unknowns = design.shape
    if count < unknowns or np.linalg.matrix_rank(design) < unknowns:
        raise ValueError("the coefficients are not determined by the observations")
    orthonormal, triangle = np.linalg.qr(design)
    residual = observed.value - orthonormal @ (orthonormal.T @ observed.value)
    sum_of_squares, free = float(residual @ residual), count - unknowns
    inverse = np.linalg.inv(triangle.T @ triangle)
    least_squares = _least_squares(observed, design, inverse)
    if free <= len(effects):
        return least_squares
    if sum_of_squares <= count * (_EQUAL * float(np.abs(observed.value).max())) ** 2:
        return _with_variance(least_squares, inverse, 0.0, free)
    variance = sum_of_squares / free
    if not effects:
        return _with_variance(least_squares, inverse, variance, free)
    return _mixed(observed, design, np.stack([np.eye(count), *map(_kernel, effects)]), variance)


def _least_squares(observed: Observations, design: Array, inverse: Array) -> Fit:
    """The coefficients without any variance to judge them by."""
    weights, nothing = inverse @ design.T, np.zeros(0)
    coefficients = weights @ observed.value
    slopes = np.zeros((0, *inverse.shape))
    return Fit(coefficients, nothing, weights, inverse, inverse, slopes, np.zeros((0, 0)), observed)


def _with_variance(least_squares: Fit, inverse: Array, variance: float, free: int) -> Fit:
    """Least squares with the variance of independent residuals."""
    return least_squares._replace(
        variances=np.array([variance]),
        covariance=variance * inverse,
        plain=variance * inverse,
        slopes=inverse[None],
        variances_covariance=np.array([[2 * variance**2 / free]]),
    )


def identifiable(design: Array, effects: Sequence[Levels]) -> list[int]:
    """Those of the effects, by index, whose variances the design tells from each other and the residual."""
    if not effects:
        return []
    orthonormal = np.linalg.qr(design)[0]
    free = len(design) - np.linalg.matrix_rank(design)

    def projected(matrix: Array) -> Array:
        left = matrix - orthonormal @ (orthonormal.T @ matrix)
        return np.asarray(left - (left @ orthonormal) @ orthonormal.T)

    kept: list[int] = []
    known = [projected(np.eye(len(design))).ravel()]
    for number, levels in enumerate(effects):
        tried = [*known, projected(_kernel(levels)).ravel()]
        gram = np.array([[one @ other for other in tried] for one in tried])
        scale = np.sqrt(np.diagonal(gram))
        regular = bool(np.all(scale > _SINGULAR))
        if (
            regular
            and np.linalg.eigvalsh(gram / np.outer(scale, scale))[0] > _SINGULAR
            and free > len(kept) + 1
        ):
            kept.append(number)
            known = tried
    return kept


def _kernel(levels: Levels) -> Array:
    return np.asarray((levels[:, None] == levels[None, :]).astype(np.float64))


class _State(NamedTuple):
    """The likelihood at some variances, and what it is made of."""

    variances: Array
    likelihood: float
    inverse: Array
    plain: Array
    projection: Array


def _mixed(observed: Observations, design: Array, kernels: Array, variance: float) -> Fit:
    # In units of the residual variance, so that all tolerances are relative.
    value = observed.value / np.sqrt(variance)
    state = _state(np.eye(len(kernels))[0], value, design, kernels)
    assert state is not None
    least = np.array([_SINGULAR, *(-np.inf if _is_balanced(design, one) else 0.0 for one in kernels[1:])])
    for _ in range(_STEPS):
        following = _step(state, value, design, kernels, least)
        if following is None:
            break
        state = following
    return _fitted(observed, design, kernels, state, variance)


def _is_balanced(design: Array, kernel: Array) -> bool:
    """True if the coefficients are those of least squares whatever the variance of an effect is."""
    orthonormal = np.linalg.qr(design)[0]
    spread = kernel @ orthonormal
    return bool(np.abs(spread - orthonormal @ (orthonormal.T @ spread)).max() < _SINGULAR * len(kernel))


def _state(variances: Array, value: Array, design: Array, kernels: Array) -> _State | None:
    """The restricted likelihood; None where the variance is not positive definite."""
    try:
        lower = cho_factor(np.tensordot(variances, kernels, axes=1), lower=True)
    except LinAlgError:
        return None
    sides = np.square(np.diagonal(lower[0]))
    if sides.min() < _SINGULAR * sides.max():
        return None
    inverse = cho_solve(lower, np.eye(len(value)))
    normal = design.T @ inverse @ design
    plain = np.asarray(np.linalg.inv(normal), np.float64)
    projection = inverse - inverse @ design @ plain @ design.T @ inverse
    logs = 2 * np.log(np.diagonal(lower[0])).sum() + np.linalg.slogdet(normal)[1]
    return _State(variances, -0.5 * float(logs + value @ projection @ value), inverse, plain, projection)


def _information(state: _State, kernels: Array) -> Array:
    """Expected information on the variances."""
    products = [state.projection, *(state.projection @ kernel for kernel in kernels[1:])]
    return np.array([[0.5 * np.sum(one * other.T) for other in products] for one in products])


def _step(state: _State, value: Array, design: Array, kernels: Array, least: Array) -> _State | None:
    """A step of Fisher's scoring, shortened until it gains; None where there is nothing to gain.

    Args:
        state: Where it starts.
        value: (N,) observations; with `design` and `kernels` the model.
        design: (N, P).
        kernels: (1 + K, N, N).
        least: (1 + K,) the least value of each variance.
    """
    projected = state.projection @ value
    score = np.array(
        [0.5 * (projected @ one @ projected - np.sum(state.projection * one)) for one in kernels]
    )
    free = (state.variances > least) | (score > 0)
    step = np.zeros(len(kernels))
    step[free] = np.linalg.solve(_information(state, kernels)[np.ix_(free, free)], score[free])
    promised = float(score @ step)
    if promised < _SETTLED:
        return None
    for halving in range(_HALVINGS):
        variances = np.maximum(state.variances + step * 0.5**halving, least)
        tried = _state(variances, value, design, kernels)
        if tried is not None and (promised < _SEEN or tried.likelihood > state.likelihood):
            return tried
    return None


def _fitted(observed: Observations, design: Array, kernels: Array, state: _State, variance: float) -> Fit:
    plain, inverse = state.plain, state.inverse
    spread = np.asarray(np.linalg.inv(_information(state, kernels)), np.float64)
    left = [design.T @ inverse @ kernel @ inverse for kernel in kernels]
    first = np.stack([one @ design for one in left])
    slopes = plain @ first @ plain
    second = [[one @ kernel @ inverse @ design for kernel in kernels] for one in left]
    excess = sum(
        spread[i, j] * (second[i][j] - first[i] @ plain @ first[j])
        for i in range(len(kernels))
        for j in range(len(kernels))
    )
    weights = plain @ design.T @ inverse
    return Fit(
        weights @ observed.value,
        state.variances * variance,
        weights,
        variance * (plain + 2 * plain @ excess @ plain),
        variance * plain,
        slopes,
        spread * variance**2,
        observed,
    )
