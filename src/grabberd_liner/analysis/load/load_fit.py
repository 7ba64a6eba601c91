"""The contact pressure that explains where the targets are.

Gauss–Newton on equilibrium and data at once: the wall's unknowns are eliminated by one adjoint solution for
each component of a target's place, and the step is taken in the space of the sights (a few hundred), where
the prior's covariance (thousands of parameters) need never be inverted. The posterior covariance follows
likewise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, blas, cho_solve, cholesky, lapack

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Joint
from grabberd_liner.analysis.load.targets import Sights
from grabberd_liner.analysis.load.wall_model import (
    MPA_PER_KPA,
    USUAL,
    Difference,
    Linearised,
    LoadMean,
    State,
    WallModel,
)
from grabberd_liner.analysis.wall.splines import Basis

STEPS = 60
"""Of Gauss and Newton; from the open wall to a closed one some twenty are taken."""
_LONGEST_MM = 1.0
"""Of a step of the wall's unknowns: farther away its stiffness is another."""
_SLOWING, _SHORTENED = 0.5, 0.6
"""A step longer than half the last one swings about the minimum: it is shortened."""
NEAR_MM = 0.3
"""Next step below which the linearised model is the wall: pressures at places then err by less than .02 σ."""
_AT_ONCE = 160
"""Quantities whose prior variance is found at once, for memory."""
MISFIT_ALARM = 2.0
"""Misfit above which points and the wall's equilibrium contradict each other."""
_HINT = "give the liner's own modulus, thickness, pretension and length, and its vacuum on the camera's clock"


class _Parts(NamedTuple):
    """A prior covariance, apart by what its size changes with: variance of g, that of the gauges, neither."""

    load: Array
    difference: Array
    rest: Array

    @classmethod
    def of(cls, model: WallModel, rows: Array, spread: Array, diagonal: bool = False) -> "_Parts":
        """The covariance of rows (Q, P) and `WallModel.spread` of others (P, M), or the diagonal alone."""
        load, difference = model.of_load, model.of_difference
        # Each by itself: a small part would be lost in rounding as the rest of a large one.
        parts = (load, difference, slice(load.stop, difference.start), slice(difference.stop, None))

        def product(part: slice) -> Array:
            if diagonal:
                return np.asarray(np.einsum("qp,pq->q", rows[:, part], spread[part]), np.float64)
            return np.asarray(rows[:, part] @ spread[part], np.float64)

        of_load, of_difference, *rest = (product(part) for part in parts)
        return cls(of_load, of_difference, rest[0] + rest[1])

    def sum(self, model: WallModel, difference: Difference) -> Array:
        """The whole covariance under a pressure difference."""
        factors = model.variances(difference)
        load, gauge = (factors[part][0] for part in (model.of_load, model.of_difference))
        return load * self.load + gauge * self.difference + self.rest


class Followers(NamedTuple):
    """Q quantities of a linearised wall.

    Attributes:
        cross: (Q, 3 T) their prior covariance with the places; `variance`: (Q,) their own.
    """

    cross: _Parts
    variance: _Parts


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A linearised wall, and how far the prior lets its targets move.

    Attributes:
        model: the wall's.
        linear: the model about a state.
        spread: (P, 3 T) prior covariance of parameters and places, by `WallModel.spread`.
    """

    model: WallModel
    linear: Linearised
    spread: Array
    _covariance: "_Parts"
    _at_points: dict[Basis, Array]
    _followers: dict[object, Followers]

    @classmethod
    def of(cls, model: WallModel, state: State) -> "Response":
        """The response about a state."""
        linear = model.linearised(state)
        spread = model.spread(linear.by_parameters.T)
        return cls(model, linear, spread, _Parts.of(model, linear.by_parameters, spread), {}, {})

    def covariance_mm2(self, difference: Difference) -> Array:
        """(3 T, 3 T) prior covariance of the places."""
        return self._covariance.sum(self.model, difference)

    def at_points(self, basis: Basis) -> Array:
        """(N, 3 T) rows of `spread` of g at points of the wall; kept."""
        if basis not in self._at_points:
            self._at_points[basis] = basis.matrices[0] @ self.spread[: self.model.half.grid.count]
        return self._at_points[basis]

    def followers(self, by_parameters: Array) -> Followers:
        """Quantities (Q, P) that depend on the parameters as the places do."""
        parts = [
            _Parts.of(self.model, some, self.model.spread(some.T), diagonal=True)
            for some in np.array_split(by_parameters, -(-len(by_parameters) // _AT_ONCE))
        ]
        variance = _Parts(*(np.concatenate(part) for part in zip(*parts, strict=True)))
        return Followers(_Parts.of(self.model, by_parameters, self.spread), variance)

    def kept_followers(self, of: object, by_parameters: Callable[["Response"], Array]) -> Followers:
        """Followers that something asks for in state after state; kept as long as this."""
        if of not in self._followers:
            self._followers[of] = self.followers(by_parameters(self))
        return self._followers[of]


class Gain:
    """Knowledge that sights give of a linearised wall, whatever the load's prior mean.

    Attributes:
        response: of the wall.
        difference: pressure difference that was given.
        sights: what was seen.
        factor: (M, M) lower Cholesky factor of the sights' covariance, that by the prior included.
    """

    def __init__(self, response: Response, sights: Sights, difference: Difference) -> None:
        """Weighs the sights.

        Raises:
            LinAlgError: the wall is about to buckle.
        """
        self.response, self.sights, self.difference = response, sights, difference
        model = response.model
        covariance = sights.of_places(sights.of_places(response.covariance_mm2(difference)).T)
        covariance += sights.covariance
        of_model = sights.unit_variance() * model.prior.model_mm(difference.kpa) ** 2
        covariance[np.diag_indices_from(covariance)] += of_model
        self.factor: Array = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
        self.variance = float(model.variances(difference)[0])
        self._points: dict[Basis, Array] = {}

    @cached_property
    def root(self) -> Array:
        """(M, M) inverse of the factor: to multiply by it takes a third of the time of solving by it."""
        return np.asarray(lapack.dtrtri(self.factor, lower=True)[0], np.float64)

    def whitened(self, seen: Array) -> Array:
        """(M, N) what the sights know of quantities with prior covariance (N, M) with them."""
        return np.asarray(blas.dtrmm(1.0, self.root, seen.T, lower=True, overwrite_b=True), np.float64)

    def at_points(self, basis: Basis) -> Array:
        """(M, N) what they know of g at points of the wall; kept."""
        if basis not in self._points:
            seen = self.sights.of_places(self.response.at_points(basis))
            self._points[basis] = self.whitened(self.variance * seen)
        return self._points[basis]


@dataclass(frozen=True, eq=False)
class Posterior:
    """The load given the sights, by a model linearised near it.

    Attributes:
        gain: what the sights tell; its state is within a step of the most probable one.
        mean: prior mean of the load.
        parameters: (P,) the most probable ones.
        j: misfit of sights and prior per sight, about .3–.9; above 2 they contradict each other.
        weighted: (M,) sights' distances from the prior's, by the inverse of their covariance.
    """

    gain: Gain
    mean: LoadMean
    parameters: Array
    j: float
    weighted: Array

    @classmethod
    def of(cls, gain: Gain, mean: LoadMean) -> "Posterior":
        """The load by a prior mean."""
        response, sights, difference = gain.response, gain.sights, gain.difference
        model, linear = response.model, response.linear
        before = model.mean(difference, mean)
        expected = linear.places_mm.ravel() - linear.by_parameters @ (linear.state.parameters - before)
        innovation = sights.value - sights.of_places(expected[np.newaxis])[0]
        weighted = cho_solve((gain.factor, True), innovation, check_finite=False)
        j = float(innovation @ weighted) / len(sights)
        pull = sights.directions(len(linear.places_mm)).T @ weighted
        parameters = before + model.variances(difference) * (response.spread @ pull)
        return cls(gain, mean, parameters, j, weighted)

    @property
    def response(self) -> Response:
        """The model, linearised."""
        return self.gain.response

    @property
    def difference(self) -> Difference:
        """Pressure difference that was given."""
        return self.gain.difference

    @property
    def sights(self) -> Sights:
        """Sights that were weighed."""
        return self.gain.sights

    @property
    def model(self) -> WallModel:
        """The wall's model."""
        return self.response.model

    @property
    def linear(self) -> Linearised:
        """The model that was linearised."""
        return self.response.linear

    @property
    def change(self) -> Array:
        """(P,) parameters' change from the linearised state."""
        return self.parameters - self.linear.state.parameters

    @cached_property
    def unknowns(self) -> Array:
        """(n,) movement of the wall's unknowns from the linearised state."""
        return self.linear.unknowns(self.change)

    @property
    def longest_mm(self) -> float:
        """Longest part of that movement."""
        return float(np.abs(self.unknowns).max())

    def moved(self, share: float = 1.0) -> State:
        """The linearised state moved by a share of the way to the most probable wall."""
        return self.model.moved(self.linear.state, share * self.unknowns, share * self.change)

    @cached_property
    def control(self) -> Array:
        """(K, 4) control values of the most probable wall."""
        return self.moved().control

    @cached_property
    def outward_mm(self) -> float:
        """Movement of the wall's middle towards the cameras, in the median of its heights."""
        grid = self.model.half.grid
        moved = (self.control - self.model.half.mounted)[:, 2].reshape(grid.along.count, grid.around.count)
        return float(np.median(moved[:, grid.around.count // 2]))

    @property
    def places_mm(self) -> Array:
        """(T, 3) targets."""
        moved = self.linear.by_parameters @ self.change
        return self.linear.places_mm + moved.reshape(-1, 3)

    def places_covariance(self, shared_mm2: Array) -> Array:
        """(3 T, 3 T) of the targets' places, the model's error and the part shared by all states included."""
        prior = self.response.covariance_mm2(self.difference) + shared_mm2
        prior[np.diag_indices_from(prior)] += self.model.prior.model_mm(self.difference.kpa) ** 2
        return self._left(prior, self.sights.of_places(prior))

    @cached_property
    def outlying(self) -> Array:
        """(T,) χ² of each target's distance from where all others say it is; 0 for one that was not seen."""
        distance = np.zeros(len(self.linear.places_mm))
        order = np.argsort(self.sights.target, kind="stable")
        seen, first, count = np.unique(self.sights.target[order], return_index=True, return_counts=True)
        for components in np.unique(count):
            rows = order[first[count == components, np.newaxis] + np.arange(components)]
            # Blocks of the inverse covariance, from its root's columns.
            root = self.gain.root.T[rows]
            pull = self.weighted[rows]
            prediction = np.linalg.solve(root @ root.transpose(0, 2, 1), pull[..., np.newaxis])[..., 0]
            distance[seen[count == components]] = (pull * prediction).sum(axis=1)
        return distance

    def contact_kpa(self, basis: Basis) -> tuple[Array, Array]:
        """Median contact pressure at points of the wall (N,), and its covariance (N, N) in kPa²."""
        g = basis.matrices[0] @ self.model.field(self.parameters, 0)
        known = self.gain.at_points(basis)
        covariance = self.gain.variance * _unit_covariance(self.model, basis) - known.T @ known
        sigma = np.sqrt(np.diagonal(covariance))
        pressure, _ = self.model.prior.contact_mpa(g)
        # Not by the slope at the median: without contact, that is too flat for all that g may be.
        scale = self.model.prior.spread_mpa(g, sigma) / sigma
        return pressure / MPA_PER_KPA, covariance * np.outer(scale, scale) / MPA_PER_KPA**2

    def contact_sums(self, basis: Basis, weights: Array) -> Joint:
        """Sums of the contact pressure over groups of points of the wall, with their covariance.

        Much cheaper than the covariance of all the points.

        Args:
            basis: at G Q points, group after group.
            weights: (G, S, Q) weight of each of a group's points in its S sums, per kPa.

        Returns:
            G S sums.
        """
        model, groups = self.model, len(weights)
        g = basis.matrices[0] @ model.field(self.parameters, 0)
        unit, variance = _unit_covariance(model, basis), self.gain.variance
        prior, whitened = variance * np.diagonal(unit), self.gain.at_points(basis)
        # Rounding must not leave a place that is very well known with no σ at all.
        sigma = np.sqrt(np.maximum(prior - _squares(whitened), 1e-6 * prior))
        pressure, _ = model.prior.contact_mpa(g)
        scaled = weights * (model.prior.spread_mpa(g, sigma) / sigma).reshape(groups, 1, -1)
        half = (scaled @ unit.reshape(groups, scaled.shape[2], -1)).reshape(-1, *scaled.shape[::2])
        known = (
            (half.transpose(1, 0, 2) @ scaled.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(len(half), -1)
        )
        seen = scaled @ whitened.T.reshape(groups, scaled.shape[2], -1)
        seen = seen.reshape(len(half), -1)
        values = (weights @ pressure.reshape(groups, -1, 1)).ravel()
        return Joint(values / MPA_PER_KPA, (variance * known - seen @ seen.T) / MPA_PER_KPA**2)

    def noise_of_sums(
        self, basis: Basis, weights: Array, followers: Followers, reference_mm2: Array
    ) -> tuple[Array, Array]:
        """Covariances (G S + Q, G S + Q) by the noise of what was seen alone: of the same sums, of followers.

        What was known before moves them as well, but alike in all captures that are given the same.

        Args:
            basis: as for `contact_sums`.
            weights: likewise.
            followers: Q further quantities of the wall that was linearised.
            reference_mm2: (3 T, 3 T) part of the sights' covariance that is the reference state's.

        Returns:
            That of this state's own points, and that of the reference state's.
        """
        model, groups = self.model, len(weights)
        _, slope = model.prior.contact_mpa(basis.matrices[0] @ model.field(self.parameters, 0))
        scaled = weights * slope.reshape(groups, 1, -1)
        whitened = self.gain.at_points(basis)
        seen = (scaled @ whitened.T.reshape(groups, scaled.shape[2], -1)).reshape(-1, len(whitened))
        cross = followers.cross.sum(model, self.difference)
        others = self.gain.whitened(self.sights.of_places(cross)).T
        joint = np.concatenate([seen / MPA_PER_KPA, others])
        gain = joint @ self.gain.root
        of_reference = self.sights.of_places(self.sights.of_places(reference_mm2).T)
        own = self.sights.covariance - of_reference
        return gain @ own @ gain.T, gain @ of_reference @ gain.T

    def sigma(self, followers: Followers) -> Array:
        """(Q,) σ of quantities of the wall that was linearised."""
        cross = followers.cross.sum(self.model, self.difference)
        whitened = self.gain.whitened(self.sights.of_places(cross))
        prior = followers.variance.sum(self.model, self.difference)
        # Rounding must not leave what is very well known with no σ at all.
        left = np.maximum(prior - _squares(whitened), 1e-9 * prior)
        return np.sqrt(left)

    def tube_values(self) -> tuple[Array, Array]:
        """Changes of ln E, ln t, ln F₀, and the pressure difference in MPa (4,); covariance (4, 4)."""
        part, factors = self.model.of_tube, self.model.variances(self.difference)
        seen = self.sights.of_places(factors[part, np.newaxis] * self.response.spread[part])
        covariance = self._left(self.model.tube_covariance(self.difference), seen)
        return self.model.tube_values(self.parameters), covariance

    @property
    def liner_misfit(self) -> float:
        """χ² by which the liner's own three values are away from what was known of them."""
        away = self.model.tube_values(self.parameters)[:-1]
        return float(away @ np.linalg.solve(self.model.tube_prior.covariance, away))

    def _left(self, prior: Array, seen: Array) -> Array:
        """(N, N) posterior covariance, from the prior one and that with the sights (N, M)."""
        whitened = self.gain.whitened(seen)
        return prior - whitened.T @ whitened


def _squares(columns: Array) -> Array:
    """(N,) sums of squares of columns (M, N)."""
    return np.asarray(np.einsum("mn,mn->n", columns, columns), np.float64)


@lru_cache(maxsize=4)
def _unit_covariance(model: WallModel, basis: Basis) -> Array:
    """(N, N) prior covariance of g at points of the wall, by `WallModel.spread`."""
    at = basis.matrices[0]
    columns = np.zeros((3, *at.shape[::-1]))
    columns[0] = at.T.toarray()
    return np.asarray(at @ model.prior.spread(model.half.grid, columns)[0], np.float64)


def posterior(
    response: Response, sights: Sights, difference: Difference, mean: LoadMean = USUAL
) -> Posterior:
    """The load given the sights, by a model that was linearised before.

    Raises:
        AnalysisError: the wall is about to buckle.
    """
    try:
        return Posterior.of(Gain(response, sights, difference), mean)
    except LinAlgError as error:
        raise AnalysisError(
            f"at {difference.kpa:.3g} kPa the wall is about to buckle: the load cannot be told",
            _HINT,
        ) from error


def fit_load(
    model: WallModel,
    sights: Sights,
    difference: Difference,
    start: State | None = None,
    mean: LoadMean = USUAL,
    near_mm: float = NEAR_MM,
) -> tuple[Posterior, int]:
    """Fits the load, and counts the steps it took.

    Args:
        model: the wall's.
        sights: what was seen of its targets.
        difference: pressure difference.
        start: a state to begin with; by default the open wall.
        mean: prior mean of the load.
        near_mm: next step below which the linearised model is the wall.

    Raises:
        AnalysisError: the wall does not settle.
    """
    state, last_mm = start or model.start(difference, mean), np.inf
    for step in range(1, STEPS + 1):
        found = posterior(Response.of(model, state), sights, difference, mean)
        longest_mm = found.longest_mm
        if longest_mm < near_mm:
            return found, step
        share = min(1.0, _LONGEST_MM / longest_mm)
        if share == 1.0 and longest_mm > _SLOWING * last_mm:
            share = _SHORTENED
        last_mm = longest_mm
        state = found.moved(share)
    raise AnalysisError(
        f"no load explains {len(sights)} sights at {difference.kpa:.3g} kPa: after {STEPS} steps the wall"
        f" still moves by {last_mm:.2g} mm a step",
        _HINT,
    )
