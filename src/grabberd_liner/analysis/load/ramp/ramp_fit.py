"""The liner's own values by equilibrium of the empty wall at several pressure differences.

Gauss–Newton on all states at once: their shapes, the values that they share, and each one's pressure
difference.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.mounted.sights import Sights
from grabberd_liner.analysis.load.ramp.empty_wall import EmptyWall, Settling

Array = NDArray[np.float64]

TUBE_VALUES = 3
"""Logarithmic changes of Young's modulus, thickness and pretension."""
_STEPS = 25
_LONGEST_MM = 0.6
"""Of a step of the wall's unknowns: farther away its stiffness is another."""
_NEAR_MM, _SETTLED_MM = 0.1, 0.01
"""Movement in a step below which a state is near enough to join the others, and below which all have
settled."""
_HINT = "check the material, the ends that hold the liner, and that nothing is in it"


class Ramp(NamedTuple):
    """Data and prior of a fit: L states.

    Attributes:
        wall: the empty wall; `sights`: of each state, with the covariance of that state alone.
        mean: (3 + L,) the values before the ramp: the liner's own, and the pressure differences in kPa.
        covariance: (3 + L, 3 + L) of `mean`.
        noise_kpa2: (L,) part of the pressure differences' variances that is each state's alone.
        reference_mm2: (3 T, 3 T) covariance of what errs alike in all states of this ramp: the open wall.
        model_mm2: (3 T, 3 T) that of what errs alike in all ramps: the model.
    """

    wall: EmptyWall
    sights: Sequence[Sights]
    mean: Array
    covariance: Array
    noise_kpa2: Array
    reference_mm2: Array
    model_mm2: Array

    @property
    def common_mm2(self) -> Array:
        """(3 T, 3 T) covariance of what errs alike in all states."""
        return self.reference_mm2 + self.model_mm2

    def of_state(self, index: int) -> list[int]:
        """The four values of one state."""
        return [*range(TUBE_VALUES), TUBE_VALUES + index]

    def directions(self, index: int) -> sparse.csr_matrix:
        """(M, 3 T) a state's sights as combinations of all targets' places."""
        return self.sights[index].directions(len(self.model_mm2) // 3)

    def weight(self, index: int) -> Array:
        """(M, M) weight of a state's sights."""
        directions = self.directions(index)
        common = directions @ (directions @ self.common_mm2).T
        return np.asarray(np.linalg.inv(self.sights[index].covariance + common), np.float64)


class RampFit(NamedTuple):
    """Result of a fit.

    Attributes:
        values: (3 + L,) as in `Ramp.mean`, with `covariance`.
        own: (3 + L, 3 + L) part of the covariance by the noise of this ramp: of its points and levels.
        misfit: (L,) of each state's sights, by coordinate; 1 is usual.
    """

    values: Array
    covariance: Array
    own: Array
    misfit: Array


def fit_ramp(ramp: Ramp, amplitude_mm: Sequence[float]) -> RampFit:
    """Fits the liner's values.

    Args:
        ramp: states by rising pressure difference.
        amplitude_mm: how far each has flattened, about: the first one that has gives the way the wall
            buckles.

    Raises:
        AnalysisError: the wall does not settle.
    """
    shapes = _followed(ramp, amplitude_mm)
    weights = [ramp.weight(index) for index in range(len(shapes))]
    prior = np.asarray(np.linalg.inv(ramp.covariance), np.float64)
    values = ramp.mean.copy()
    for _ in range(_STEPS):
        normal, right = prior.copy(), prior @ (ramp.mean - values)
        settlings = []
        for index, (shape, weight) in enumerate(zip(shapes, weights, strict=True)):
            at = ramp.of_state(index)
            settling = ramp.wall.settling(shape, values[at])
            away, by_values = _seen(ramp.sights[index], settling)
            normal[np.ix_(at, at)] += by_values.T @ weight @ by_values
            right[at] += by_values.T @ weight @ away
            settlings.append(settling)
        change = _solved(normal, right)
        moves = [_move(one, change[ramp.of_state(index)]) for index, one in enumerate(settlings)]
        longest_mm = max(float(np.abs(move).max()) for move in moves)
        share = min(1.0, _LONGEST_MM / longest_mm)
        values = values + share * change
        shapes = [ramp.wall.moved(shape, share * move) for shape, move in zip(shapes, moves, strict=True)]
        if longest_mm < _SETTLED_MM:
            misfit = [
                _misfit(*_seen(ramp.sights[index], one), change[ramp.of_state(index)], weights[index])
                for index, one in enumerate(settlings)
            ]
            return RampFit(values, *_covariances(ramp, settlings, weights, normal), np.array(misfit))
    raise _unsettled(f"all {len(shapes)} states together", longest_mm)


def _covariances(
    ramp: Ramp, settlings: Sequence[Settling], weights: Sequence[Array], normal: Array
) -> tuple[Array, Array]:
    """Covariance of the values, and its part by noise; what all states share does not average out."""
    inverse = np.asarray(np.linalg.inv(normal), np.float64)
    common_mm2, prior = ramp.common_mm2, np.asarray(np.linalg.inv(ramp.covariance), np.float64)
    total, alone = np.zeros((len(normal), len(common_mm2))), np.zeros_like(normal)
    noise = (prior[:, TUBE_VALUES:] * ramp.noise_kpa2) @ prior[TUBE_VALUES:]
    for index, (settling, weight) in enumerate(zip(settlings, weights, strict=True)):
        at = ramp.of_state(index)
        _, by_values = _seen(ramp.sights[index], settling)
        pull = by_values.T @ weight
        share = pull @ ramp.directions(index)
        total[at] += share
        alone[np.ix_(at, at)] += share @ common_mm2 @ share.T
        noise[np.ix_(at, at)] += pull @ ramp.sights[index].covariance @ pull.T
    beyond = total @ common_mm2 @ total.T - alone
    noise += total @ ramp.reference_mm2 @ total.T
    return inverse + inverse @ beyond @ inverse, inverse @ noise @ inverse


def _followed(ramp: Ramp, amplitude_mm: Sequence[float]) -> list[Array]:
    """Shapes near all states, each found from the one before."""
    # One state alone leaves the modulus to be what makes it fit, so that the path is that of the data.
    shapes, shape, tube = [], ramp.wall.open_shape, ramp.mean[:TUBE_VALUES]
    for index, amplitude in enumerate(amplitude_mm):
        at = ramp.of_state(index)
        if amplitude > 0 and not np.any(shape):
            shape = ramp.wall.flattened(amplitude)
        shape, values = _near(ramp, index, shape, np.append(tube, ramp.mean[at[-1]]))
        shapes.append(shape)
        tube = values[:TUBE_VALUES]
        shape = shape if amplitude > 0 else ramp.wall.open_shape
    return shapes


def _near(ramp: Ramp, index: int, shape: Array, values: Array) -> tuple[Array, Array]:
    at = np.ix_(ramp.of_state(index), ramp.of_state(index))
    weight, prior = ramp.weight(index), np.asarray(np.linalg.inv(ramp.covariance[at]), np.float64)
    mean = ramp.mean[ramp.of_state(index)]
    for _ in range(_STEPS):
        settling = ramp.wall.settling(shape, values)
        away, by_values = _seen(ramp.sights[index], settling)
        normal = by_values.T @ weight @ by_values + prior
        change = _solved(normal, by_values.T @ weight @ away + prior @ (mean - values))
        move = _move(settling, change)
        longest_mm = float(np.abs(move).max())
        share = min(1.0, _LONGEST_MM / longest_mm)
        shape, values = ramp.wall.moved(shape, share * move), values + share * change
        if longest_mm < _NEAR_MM:
            return shape, values
    raise _unsettled(f"{mean[-1]:.3g} kPa", longest_mm)


def _solved(normal: Array, right: Array) -> Array:
    """Change of the values.

    Raises:
        AnalysisError: the wall is nowhere near what was seen, so that nothing determines them.
    """
    try:
        return np.asarray(np.linalg.solve(normal, right), np.float64)
    except np.linalg.LinAlgError as error:
        raise AnalysisError(
            "the empty liner has no equilibrium near what was seen: nothing determines its values", _HINT
        ) from error


def _seen(sights: Sights, settling: Settling) -> tuple[Array, Array]:
    """Distances (M,) of the sights from the settled wall, and the wall's derivatives there (M, 4)."""
    directions = sights.directions(len(settling.places_mm))
    away = sights.value - directions @ (settling.places_mm.ravel() + settling.targets[:, 0])
    return away, directions @ settling.targets[:, 1:]


def _move(settling: Settling, change: Array) -> Array:
    move: Array = settling.unknowns[:, 0] + settling.unknowns[:, 1:] @ change
    return move


def _misfit(away: Array, by_values: Array, change: Array, weight: Array) -> float:
    left = away - by_values @ change
    return float(left @ weight @ left) / len(left)


def _unsettled(where: str, longest_mm: float) -> AnalysisError:
    return AnalysisError(
        f"the empty liner has no equilibrium near what was seen at {where}: after {_STEPS} steps the wall "
        f"still moves by {longest_mm:.2g} mm a step",
        _HINT,
    )
