"""The contact pressure that explains where the targets are.

Gauss–Newton on equilibrium and data at once: the wall's unknowns are eliminated by one adjoint solution for each
component of a target's place, and the step is taken in the space of the sights (a few hundred), where the prior's
covariance (thousands of parameters) need never be inverted. The posterior covariance follows by the same elimination.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from grabberd.analysis.load.load_prior import MPA_PER_KPA, Difference
from grabberd.analysis.load.sights import Sights
from grabberd.analysis.load.wall_model import TUBE_VALUES, Linearised, State, WallModel
from grabberd.analysis.wall.splines import Basis
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

STEPS = 40
"""Of Gauss and Newton; across a buckling of 6 mm some fifteen are taken."""
_LONGEST_MM = 0.6
"""Of a step of the wall's unknowns: farther away its stiffness is another."""
_SLOWING, _SHORTENED = 0.5, 0.6
"""A step longer than half the last one swings about the minimum: it is shortened."""
_SETTLED_MM, _SETTLED_SEEN_MM = 0.03, 0.002
"""Unseen parts of the wall may still move by the first; what the sights see, by the second."""
_HINT = "give the liner's own modulus, thickness, pretension and length, and its vacuum on the camera's clock"


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """The load given the sights, by a model linearised near it.

    Attributes:
        model: the wall's.
        difference: pressure difference that was given.
        linear: the model that was linearised; its state is within a step of the most probable one.
        parameters: (P,) the most probable ones.
        j: misfit of sights and prior per sight, about .3–.9; above 2 they contradict each other.
    """

    model: WallModel
    difference: Difference
    linear: Linearised
    parameters: Array
    j: float
    _spread: Array
    _factor: tuple[Array, bool]

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
        at = basis.matrices[0]
        g = at @ self.model.field(self.parameters, 0)
        covariance = self._covariance(at, 0)
        sigma = np.sqrt(np.diagonal(covariance))
        pressure, _ = self.model.prior.contact_mpa(g)
        # Not by the slope at the median: without contact, that is too flat for all that g may be.
        scale = self.model.prior.spread_mpa(g, sigma) / sigma
        return pressure / MPA_PER_KPA, covariance * np.outer(scale, scale) / MPA_PER_KPA**2

    def traction_kpa(self, basis: Basis, along: bool) -> tuple[Array, Array]:
        """Friction on the inner face (N,), round the wall or along it, and its covariance (N, N) in kPa²."""
        at = basis.matrices[0]
        traction = at @ self.model.field(self.parameters, 1 + along)
        covariance = self._covariance(at, (1 + along) * at.shape[1])
        return traction / MPA_PER_KPA, covariance / MPA_PER_KPA**2

    def tube_values(self) -> tuple[Array, Array]:
        """Changes of ln E, ln t and ln F₀, and the pressure difference in MPa (4,); their covariance (4, 4)."""
        start = 3 * self.model.half.grid.count
        values = self.model.tube_values(self.parameters)
        return values, self._covariance(sparse.identity(TUBE_VALUES, format="csr"), start)

    def _covariance(self, rows: sparse.csr_matrix, start: int) -> Array:
        """Posterior covariance of rows (N, W) of the W parameters from `start` on."""
        part = slice(start, start + rows.shape[1])
        widened = np.zeros((self.model.count, rows.shape[0]))
        widened[part] = rows.T.toarray()
        prior = rows @ self.model.spread(widened, self.difference)[part]
        seen = rows @ self._spread[part]
        covariance: Array = prior - seen @ cho_solve(self._factor, seen.T)
        return covariance


def posterior(model: WallModel, linear: Linearised, sights: Sights, difference: Difference) -> Posterior:
    """The load given the sights, by a model that was linearised before."""
    directions = sights.directions(len(linear.places_mm))
    by_parameters = directions @ linear.by_parameters
    spread = model.spread(by_parameters.T, difference)
    seen = sights.covariance + np.diag(sights.unit_variance() * model.prior.model_mm(difference.kpa) ** 2)
    factor = cho_factor(by_parameters @ spread + seen, lower=True)
    mean = model.mean(difference)
    away = sights.value - directions @ linear.places_mm.ravel()
    innovation = away + by_parameters @ (linear.state.parameters - mean)
    weighted = cho_solve(factor, innovation)
    j = float(innovation @ weighted) / len(sights)
    return Posterior(model, difference, linear, mean + spread @ weighted, j, spread, factor)


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
        linear = model.linearised(state)
        found = posterior(model, linear, sights, difference)
        unknowns = linear.unknowns(found.change)
        longest_mm = float(np.abs(unknowns).max())
        seen_mm = float(np.abs(found.places_mm - model.places_mm(state)).max())
        if longest_mm < _SETTLED_MM and seen_mm < _SETTLED_SEEN_MM:
            return found, step
        share = min(1.0, _LONGEST_MM / longest_mm)
        if share == 1.0 and longest_mm > _SLOWING * last_mm:
            share = _SHORTENED
        last_mm = longest_mm
        state = model.moved(state, share * unknowns, share * found.change)
    raise AnalysisError(
        f"no load explains {len(sights)} sights at {difference.kpa:.3g} kPa: after {STEPS} steps the wall still "
        f"moves by {last_mm:.2g} mm a step",
        _HINT,
    )
