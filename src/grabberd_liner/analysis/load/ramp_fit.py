"""The liner's own values by equilibrium of the empty wall at several pressure differences.

Gauss–Newton on all states at once: their shapes, the values that they share, and each one's pressure
difference. What is known of a mounted liner is its outer face, where the targets are, so a thicker wall is
one whose middle lies farther in: had it its middle where it was, the targets would say how thick it is.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.targets import Sights, TargetPlaces, Targets
from grabberd_liner.analysis.load.wall_model import MPA_PER_KPA
from grabberd_liner.analysis.wall.half_tube import HalfTube
from grabberd_liner.analysis.wall.shell import Load

_BY_VALUE = np.diag([1e-4, 1e-4, 1e-4, 1e-1])
"""Of difference quotients by a state's values: their squares are far below what a residual rounds to."""


class Settling(NamedTuple):
    """Movement of an empty wall towards equilibrium and with its values, about a state.

    Attributes:
        places_mm: (T, 3) targets in that state.
        unknowns: (n, 5) what its unknowns still move by, then their derivatives by the four values.
        targets: (3 T, 5) the same of the targets.
    """

    places_mm: Array
    unknowns: Array
    targets: Array


class EmptyWall:
    """The wall. The hidden half is the mirror image of the seen one.

    Its four values are the logarithmic changes of Young's modulus, thickness and pretension from those of the
    mounted tube, and the pressure difference in kPa. Its shape is the departure (K, 4) of its control values
    from those of the open wall.
    """

    def __init__(self, half: HalfTube, targets: Targets) -> None:
        """Takes a mounted wall with targets."""
        self._half = half
        self._places = TargetPlaces(half, targets)
        self._none = np.zeros(len(half.s_mm))
        across = half.mounted[:, 1:3]
        outward = across / np.linalg.norm(across, axis=1, keepdims=True)
        self._outward = np.zeros_like(half.mounted)
        self._outward[:, 1:3] = outward

    @property
    def open_shape(self) -> Array:
        """(K, 4) shape of the open wall."""
        return np.zeros_like(self._half.mounted)

    def flattened(self, amplitude_mm: float) -> Array:
        """(K, 4) shape of a wall that has flattened towards the middle without stretching round it, about."""
        x, y, z, _ = self._half.mounted.T
        theta = np.arctan2(y, z)
        along = amplitude_mm * np.cos(np.pi * x / self._half.tube.length_mm) ** 2
        inward, aside = along * np.cos(2 * theta), along * np.sin(2 * theta) / 2
        shape = -inward[:, np.newaxis] * self._outward
        shape[:, 1] += aside * np.cos(theta)
        shape[:, 2] -= aside * np.sin(theta)
        free = self._half.cuts.free
        unknowns = free.T @ shape.ravel() / np.asarray(free.sum(axis=0)).ravel()
        return self._half.moved(self.open_shape, unknowns)

    def places_mm(self, shape: Array, values: Array) -> Array:
        """(T, 3) targets."""
        half = self._of(values)
        return self._places.places_mm(half, half.mounted + shape)

    def moved(self, shape: Array, unknowns: Array) -> Array:
        """(K, 4) shape moved by its unknowns (n,)."""
        return self._half.moved(shape, unknowns)

    def settling(self, shape: Array, values: Array) -> Settling:
        """The wall about a state."""
        half = self._of(values)
        control = half.mounted + shape
        residual, places = self._state(shape, values)
        stepped = [(self._state(shape, values + step), step.sum()) for step in _BY_VALUE]
        forces = [residual, *((force - residual) / size for (force, _), size in stepped)]
        moved = [np.zeros(places.size), *((there - places).ravel() / size for (_, there), size in stepped)]
        factors = half.tangent(control, self._load(values)).factors
        unknowns = factors.solve(np.column_stack(forces))
        by_control = self._places.by_control(half, control)
        targets = by_control @ (half.cuts.free @ unknowns) + np.column_stack(moved)
        return Settling(places, unknowns, targets)

    def _state(self, shape: Array, values: Array) -> tuple[Array, Array]:
        """(n,) force out of balance, and (T, 3) targets."""
        half = self._of(values)
        control = half.mounted + shape
        return half.residual(control, self._load(values)), self._places.places_mm(half, control)

    def _of(self, values: Array) -> HalfTube:
        tube = self._half.tube.changed(*values[:3])
        inward_mm = (tube.thickness_mm - self._half.tube.thickness_mm) / 2
        tube = replace(tube, radius_mm=tube.radius_mm - inward_mm)
        return self._half.of(tube, self._half.mounted - inward_mm * self._outward)

    def _load(self, values: Array) -> Load:
        return Load(float(values[3]) * MPA_PER_KPA, self._none, np.stack([self._none, self._none]))


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
    return settling.unknowns[:, 0] + settling.unknowns[:, 1:] @ change


def _misfit(away: Array, by_values: Array, change: Array, weight: Array) -> float:
    left = away - by_values @ change
    return float(left @ weight @ left) / len(left)


def _unsettled(where: str, longest_mm: float) -> AnalysisError:
    return AnalysisError(
        f"the empty liner has no equilibrium near what was seen at {where}: after {_STEPS} steps the wall "
        f"still moves by {longest_mm:.2g} mm a step",
        _HINT,
    )
