"""A linear model with fixed coefficients and random effects, fitted by restricted maximum likelihood.

The variance of the observations is θ₀ I + Σ θₖ Zₖ Zₖᵀ. Where the weights of the observations do not depend
on it, as in a balanced design, a variance of an effect may come out negative, as it does in an analysis of
variance: with few levels this keeps the tests honest, and gives exactly the classical ones. σ and degrees of
freedom are after Kenward and Roger, Biometrics 53 (1997) 983. What the observations share is propagated
through the same linear combination, as the GUM does, and never weighs them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from grabberd_liner.analysis.study.contrast import Contrast, contrast
from grabberd_liner.analysis.study.observations import Array, Levels, Observations

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
