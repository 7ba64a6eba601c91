"""The contact pressure that explains where the targets are.

Gauss–Newton on equilibrium and data at once: the wall's unknowns are eliminated by one adjoint solution for
each component of a target's place, and the step is taken in the space of the sights (a few hundred), where
the prior's covariance (thousands of parameters) need never be inverted. The posterior covariance follows
likewise.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular

from grabberd.analysis.estimate import Joint
from grabberd.analysis.load.load_prior import MPA_PER_KPA, Difference
from grabberd.analysis.load.sights import Sights
from grabberd.analysis.load.wall_model import TUBE_VALUES, Linearised, State, WallModel
from grabberd.analysis.wall.splines import Basis
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

STEPS = 60
"""Of Gauss and Newton; from the open wall to a closed one some twenty are taken."""
_LONGEST_MM = 1.0
"""Of a step of the wall's unknowns: farther away its stiffness is another."""
_SLOWING, _SHORTENED = 0.5, 0.6
"""A step longer than half the last one swings about the minimum: it is shortened."""
NEAR_MM = 0.3
"""Next step below which the linearised model is the wall: pressures then err by less than .02 σ."""
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
        whole: Array = load * self.load + gauge * self.difference + self.rest
        return whole


class Followers(NamedTuple):
    """Q quantities of a linearised wall.

    Attributes:
        response: of that wall.
        cross: (Q, 3 T) their prior covariance with the places; `variance`: (Q,) their own.
    """

    response: "Response"
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

    @classmethod
    def of(cls, model: WallModel, state: State) -> "Response":
        """The response about a state."""
        linear = model.linearised(state)
        spread = model.spread(linear.by_parameters.T)
        return cls(model, linear, spread, _Parts.of(model, linear.by_parameters, spread))

    def covariance_mm2(self, difference: Difference) -> Array:
        """(3 T, 3 T) prior covariance of the places."""
        return self._covariance.sum(self.model, difference)

    def followers(self, by_parameters: Array) -> "Followers":
        """Quantities (Q, P) that depend on the parameters as the places do."""
        own = self.model.spread(by_parameters.T)
        return Followers(
            self,
            _Parts.of(self.model, by_parameters, self.spread),
            _Parts.of(self.model, by_parameters, own, diagonal=True),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """The load given the sights, by a model linearised near it.

    Attributes:
        response: of the model; its state is within a step of the most probable one.
        difference: pressure difference that was given.
        parameters: (P,) the most probable ones.
        j: misfit of sights and prior per sight, about .3–.9; above 2 they contradict each other.
    """

    response: Response
    difference: Difference
    parameters: Array
    j: float
    _directions: sparse.csr_matrix
    _factor: tuple[Array, bool]

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
        change: Array = self.parameters - self.linear.state.parameters
        return change

    @property
    def places_mm(self) -> Array:
        """(T, 3) targets."""
        moved = self.linear.by_parameters @ self.change
        places: Array = self.linear.places_mm + moved.reshape(-1, 3)
        return places

    def contact_kpa(self, basis: Basis) -> tuple[Array, Array]:
        """Median contact pressure at points of the wall (N,), and its covariance (N, N) in kPa²."""
        g = basis.matrices[0] @ self.model.field(self.parameters, 0)
        covariance = self._field_covariance(basis, 0)
        sigma = np.sqrt(np.diagonal(covariance))
        pressure, _ = self.model.prior.contact_mpa(g)
        # Not by the slope at the median: without contact, that is too flat for all that g may be.
        scale = self.model.prior.spread_mpa(g, sigma) / sigma
        return pressure / MPA_PER_KPA, covariance * np.outer(scale, scale) / MPA_PER_KPA**2

    def contact_sums(self, basis: Basis, shares: Array, weights: Array) -> Joint:
        """Sums of the contact pressure at points of the wall, with their covariance.

        Much cheaper than the covariance of all the points.

        Args:
            basis: at N points.
            shares: (N,) `LoadPrior.variance_shares` there.
            weights: (S, N) weight of each point in each sum, per kPa.
        """
        at, model = basis.matrices[0], self.model
        g = at @ model.field(self.parameters, 0)
        variance, whitened = float(model.variances(self.difference)[0]), self._whitened()
        prior = variance * shares
        # Rounding must not leave a place that is very well known with no σ at all.
        sigma = np.sqrt(np.maximum(prior - ((at @ whitened) ** 2).sum(axis=1), 1e-6 * prior))
        pressure, _ = model.prior.contact_mpa(g)
        scale = model.prior.spread_mpa(g, sigma) / sigma
        rows = sparse.csr_matrix((weights * scale) @ at)
        seen = rows @ whitened
        covariance = variance * (rows @ _unit_covariance_of_load(model) @ rows.T) - seen @ seen.T
        return Joint(weights @ pressure / MPA_PER_KPA, covariance / MPA_PER_KPA**2)

    def _whitened(self) -> Array:
        """(K, M) of g's control values; its square is the variance that the sights take away."""
        factor, lower = self._factor
        of_load = self.model.of_load
        factors = self.model.variances(self.difference)[of_load, np.newaxis]
        seen = (factors * self.response.spread[of_load]) @ self._directions.T
        whitened: Array = solve_triangular(factor, seen.T, lower=lower).T
        return whitened

    def sigma(self, followers: Followers) -> Array:
        """(Q,) σ of quantities of the wall that was linearised."""
        seen = followers.cross.sum(self.model, self.difference) @ self._directions.T
        factor, lower = self._factor
        whitened = solve_triangular(factor, seen.T, lower=lower)
        prior = followers.variance.sum(self.model, self.difference)
        # Rounding must not leave what is very well known with no σ at all.
        left = np.maximum(prior - (whitened * whitened).sum(axis=0), 1e-9 * prior)
        sigma: Array = np.sqrt(left)
        return sigma

    def settled(self) -> Array:
        """(K, 4) control values of the most probable wall."""
        state, change = self.linear.state, self.change
        return self.model.moved(state, self.linear.unknowns(change), change).control

    def traction_kpa(self, basis: Basis, along: bool) -> tuple[Array, Array]:
        """Friction on the inner face (N,), round the wall or along it, and its covariance (N, N) in kPa²."""
        traction = basis.matrices[0] @ self.model.field(self.parameters, 1 + along)
        return traction / MPA_PER_KPA, self._field_covariance(basis, 1 + along) / MPA_PER_KPA**2

    def tube_values(self) -> tuple[Array, Array]:
        """Changes of ln E, ln t, ln F₀, and the pressure difference in MPa (4,); covariance (4, 4)."""
        start = 3 * self.model.half.grid.count
        part = slice(start, start + TUBE_VALUES)
        rows = np.zeros((self.model.count, TUBE_VALUES))
        rows[part] = np.eye(TUBE_VALUES)
        prior = self.model.variances(self.difference)[part, np.newaxis] * self.model.spread(rows)[part]
        one = sparse.identity(TUBE_VALUES, format="csr")
        return self.model.tube_values(self.parameters), self._covariance(one, part, prior)

    def _field_covariance(self, basis: Basis, index: int) -> Array:
        count = self.model.half.grid.count
        part = slice(index * count, (index + 1) * count)
        prior = self.model.variances(self.difference)[part][0] * _unit_covariances(self.model, basis)[index]
        return self._covariance(basis.matrices[0], part, prior)

    def _covariance(self, rows: sparse.csr_matrix, part: slice, prior: Array) -> Array:
        """(N, N) posterior covariance of rows (N, W) of the parameters `part`, from their prior one."""
        factors = self.model.variances(self.difference)[part, np.newaxis]
        seen = rows @ (factors * self.response.spread[part]) @ self._directions.T
        covariance: Array = prior - seen @ cho_solve(self._factor, seen.T)
        return covariance


@lru_cache(maxsize=4)
def _unit_covariances(model: WallModel, basis: Basis) -> list[Array]:
    """(N, N) prior covariances of g and of both tractions at points of the wall, by `WallModel.spread`."""
    at, count = basis.matrices[0], model.half.grid.count
    columns = np.zeros((model.count, 3, at.shape[0]))
    for index in range(3):
        columns[index * count : (index + 1) * count, index] = at.T.toarray()
    spread = model.spread(columns.reshape(model.count, -1)).reshape(columns.shape)
    return [at @ spread[index * count : (index + 1) * count, index] for index in range(3)]


@lru_cache(maxsize=4)
def _unit_covariance_of_load(model: WallModel) -> Array:
    """(K, K) prior covariance of g's control values, by `WallModel.spread`."""
    count = model.half.grid.count
    columns = np.zeros((3, count, count))
    columns[0] = np.eye(count)
    covariance: Array = model.prior.spread(model.half.grid, columns)[0]
    return covariance


def posterior(response: Response, sights: Sights, difference: Difference) -> Posterior:
    """The load given the sights, by a model that was linearised before.

    Raises:
        AnalysisError: the wall is about to buckle.
    """
    model, linear = response.model, response.linear
    directions = sights.directions(len(linear.places_mm))
    covariance = directions @ (directions @ response.covariance_mm2(difference)).T + sights.covariance
    of_model = sights.unit_variance() * model.prior.model_mm(difference.kpa) ** 2
    try:
        factor = cho_factor(covariance + np.diag(of_model), lower=True)
    except LinAlgError as error:
        raise AnalysisError(
            f"at {difference.kpa:.3g} kPa the wall is about to buckle: the load cannot be told",
            _HINT,
        ) from error
    mean = model.mean(difference)
    expected = linear.places_mm.ravel() - linear.by_parameters @ (linear.state.parameters - mean)
    innovation = sights.value - directions @ expected
    weighted = cho_solve(factor, innovation)
    j = float(innovation @ weighted) / len(sights)
    parameters = mean + model.variances(difference) * (response.spread @ (directions.T @ weighted))
    return Posterior(response, difference, parameters, j, directions, factor)


def fit_load(
    model: WallModel, sights: Sights, difference: Difference, start: State | None = None
) -> tuple[Posterior, int]:
    """Fits the load, and counts the steps it took.

    Args:
        model: the wall's.
        sights: what was seen of its targets.
        difference: pressure difference.
        start: a state to begin with; by default the open wall.

    Raises:
        AnalysisError: the wall does not settle.
    """
    state, last_mm = start or model.start(difference), np.inf
    for step in range(1, STEPS + 1):
        found = posterior(Response.of(model, state), sights, difference)
        unknowns = found.linear.unknowns(found.change)
        longest_mm = float(np.abs(unknowns).max())
        if longest_mm < NEAR_MM:
            return found, step
        share = min(1.0, _LONGEST_MM / longest_mm)
        if share == 1.0 and longest_mm > _SLOWING * last_mm:
            share = _SHORTENED
        last_mm = longest_mm
        state = model.moved(state, share * unknowns, share * found.change)
    raise AnalysisError(
        f"no load explains {len(sights)} sights at {difference.kpa:.3g} kPa: after {STEPS} steps the wall"
        f" still moves by {last_mm:.2g} mm a step",
        _HINT,
    )
