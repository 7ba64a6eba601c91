"""A loaded wall as a function of its parameters: the load, the liner's own values, and its cuts.

A state is a wall with its parameters; it need not be in equilibrium. Linearised, it says how the targets
follow the parameters once the wall has settled, so that a step towards the data and one towards equilibrium
are the same.

Prior knowledge of the load and of the liner, before any field is looked at.

A teat cannot pull, so the contact pressure is a rising function of a Gaussian process g that is nowhere
negative,

    p = (g + √(g² + 4 b²)) / 2

with b a few kPa: p ≈ g where the teat presses, and dies out where it does not. Unlike an exponential or a
soft plus it falls off so slowly that a place without contact is never too dead for a step to wake it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from grabberd.core.arrays import Array
from grabberd_liner.analysis.load.targets import TargetPlaces, Targets
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube, Tangent, cut_points
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.analysis.wall.rubber import Factors, Forces
from grabberd_liner.analysis.wall.shell import Load, Work
from grabberd_liner.analysis.wall.splines import Basis, SplineGrid

MPA_PER_KPA = 1e-3
_NUGGET = 1e-8
"""Share of the variance that keeps a covariance of neighbouring splines positive definite in rounding."""
_EXACT = 1e-4
"""Relative σ of a value of the liner that is given as exact."""
_NORMAL, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_SHARES = _WEIGHTS / _WEIGHTS.sum()
"""Points of Gauss–Hermite quadrature over g, and their shares: a contact pressure's moments to 1e-4."""


@dataclass(frozen=True, slots=True)
class LoadPrior:
    """Prior of the load on the inner face.

    Attributes:
        softness_kpa: b, under which a contact pressure dies out.
        amplitude: standard deviation of g, by the pressure difference: the wall has no more to press with.
        least_kpa: the pressure difference is taken for at least that.
        round_mm, along_mm: lengths over which g is correlated.
        traction_kpa: standard deviation of friction, in either direction.
        shift_mm, turn_rad, force_n_per_mm: standard deviations of what the hidden half does to the cuts.
        cut_mm: length over which that is correlated.
        model_mm_per_kpa2: standard deviation by which a target is elsewhere than in the model's wall, in any
            direction, over the square of the pressure difference: what splines and rubber do not follow.
    """

    softness_kpa: float = 2.5
    amplitude: float = 1.4
    least_kpa: float = 15.0
    round_mm: float = 6.0
    along_mm: float = 4.5
    traction_kpa: float = 4.5
    shift_mm: float = 0.7
    turn_rad: float = 0.06
    force_n_per_mm: float = 0.05
    cut_mm: float = 20.0
    model_mm_per_kpa2: float = 9e-6

    def contact_mpa(self, g_mpa: Array) -> tuple[Array, Array]:
        """Contact pressure, and its derivative by g."""
        softness = self.softness_kpa * MPA_PER_KPA
        root = np.sqrt(g_mpa**2 + 4 * softness**2)
        return (g_mpa + root) / 2, (1 + g_mpa / root) / 2

    def spread_mpa(self, g_mpa: Array, sigma_mpa: Array) -> Array:
        """Standard deviation of the contact pressure for a g with a standard deviation of its own."""
        pressures, _ = self.contact_mpa(g_mpa[..., np.newaxis] + sigma_mpa[..., np.newaxis] * _NORMAL)
        mean = pressures @ _SHARES
        return np.sqrt(((pressures - mean[..., np.newaxis]) ** 2) @ _SHARES)

    def model_mm(self, difference_kpa: float) -> float:
        """Standard deviation of the model's own error in a target's place."""
        return self.model_mm_per_kpa2 * difference_kpa**2

    def _scale_mpa(self, difference_kpa: float) -> float:
        return max(difference_kpa, self.least_kpa) * MPA_PER_KPA

    def mean_mpa(self, grid: SplineGrid, difference_kpa: float, mean: "LoadMean") -> Array:
        """(K,) prior mean of g's control values under a pressure difference."""
        turned = np.minimum(np.abs(grid.around.greville) / grid.around.greville[-1], mean.level)
        around = self._scale_mpa(difference_kpa) * (mean.crest - mean.falloff * turned**2)
        return np.tile(around, grid.along.count)

    def scale_mpa(self, difference_kpa: float) -> float:
        """Standard deviation of g under a pressure difference."""
        return self.amplitude * self._scale_mpa(difference_kpa)

    def spread(self, grid: SplineGrid, columns: Array) -> Array:
        """(3, K, M) prior covariance times columns (3, K, M): of g by its variance, of tractions in MPa²."""
        around = _correlation(grid.around.greville, self.round_mm)
        along = _correlation(grid.along.greville, self.along_mm)
        # The covariance of a grid is the product of its rows' and its columns'.
        parts = along @ columns.reshape(3, grid.along.count, -1)
        spread = (around @ parts.reshape(3, grid.along.count, grid.around.count, -1)).reshape(columns.shape)
        spread += _NUGGET * columns
        spread[1:] *= self._traction_mpa2
        return np.asarray(spread, np.float64)

    @property
    def _traction_mpa2(self) -> float:
        return (self.traction_kpa * MPA_PER_KPA) ** 2

    def cut_covariances(self, grid: SplineGrid) -> list[Array]:
        """(A, A) covariances of both cuts' shift (mm²), turn (rad²) and force (N²/mm²)."""
        along = grid.along.greville[cut_points(grid)]
        correlation = _correlation(along, self.cut_mm) + _NUGGET * np.eye(len(along))
        deviations = (self.shift_mm, self.turn_rad, self.force_n_per_mm)
        return [sigma**2 * correlation for sigma in deviations for _ in range(2)]


class LoadMean(NamedTuple):
    """Prior mean of g round the wall, by the pressure difference.

    Attributes:
        crest: on the line that faces the cameras.
        falloff: by how much it falls with the square of the way to the cuts: the wall folds there, away from
            the teat.
        level: the part of the way from which on it is level.
    """

    crest: float
    falloff: float
    level: float


USUAL = LoadMean(-1.0, 8.0, 0.5)
WIDE = LoadMean(-0.5, 4.0, 0.7)
"""Of a wall that presses far round its teat.

The usual prior takes that for so unlikely, row by row, that it would rather have a stiffer and thicker wall.
Of a wall that presses little, on the other hand, this one makes too much.
"""


@dataclass(frozen=True, slots=True)
class TubePrior:
    """Prior knowledge of the liner.

    Attributes:
        young, thickness, pretension: standard deviations of the logarithms.
        correlations: of young and thickness, young and pretension, thickness and pretension.
    """

    young: float
    thickness: float
    pretension: float
    correlations: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, material: Material) -> "TubePrior":
        """Prior knowledge from a material."""
        return cls(
            max(material.E_sigma_mpa / material.E_mpa, _EXACT),
            max(material.wall_sigma_mm / material.wall_mm, _EXACT),
            max(material.F0_sigma_n / material.F0_n, _EXACT) if material.F0_n else _EXACT,
            material.correlations,
        )

    @property
    def covariance(self) -> Array:
        """(3, 3) of the logarithms."""
        sigma = np.array([self.young, self.thickness, self.pretension])
        upper = np.zeros((3, 3))
        upper[np.triu_indices(3, 1)] = self.correlations
        return np.outer(sigma, sigma) * (np.eye(3) + upper + upper.T)


class Difference(NamedTuple):
    """Pressure difference, outside over inside, with its standard deviation."""

    kpa: float
    sigma_kpa: float


def _correlation(at_mm: Array, length_mm: float) -> Array:
    distance = (at_mm[:, np.newaxis] - at_mm) / length_mm
    return np.exp(-0.5 * distance**2)


_SMALL = 1e-4
"""Step of a logarithm: its square is far below what a residual rounds to."""
_AT_ONCE = 160
"""Adjoint solutions at once: more are no faster."""
TUBE_VALUES = 4
"""Logarithmic changes of Young's modulus, thickness and pretension; the pressure difference in MPa."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A wall and what loads it.

    Attributes:
        control: (K, 4) control values.
        parameters: (P,) values in the order of `WallModel`.
    """

    control: Array
    parameters: Array


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """Response of a wall about a state: how it settles and follows its parameters.

    Attributes:
        state: that state.
        places_mm: (T, 3) targets once the wall has settled.
        by_parameters: (3 T, P) derivatives of the settled places.
        settling: (n,) what its unknowns still move by.
        factors: of the wall's stiffness; `forces`: derivative of its out-of-balance force.
    """

    state: State
    places_mm: Array
    by_parameters: Array
    settling: Array
    factors: Factors
    forces: Forces

    def unknowns(self, change: Array) -> Array:
        """(n,) movement of the wall's unknowns with a change of the parameters (P,)."""
        return self.settling + self.factors.solve(self.forces.of(change))


class WallModel:
    """The model.

    Parameters are, one after the other, control values of g, of the traction round the wall and along it (K
    each, MPa), the `TUBE_VALUES`, and if the hidden half is free, both cuts' shift (mm), turn (rad) and force
    across (N/mm).

    Attributes:
        half: the half tube.
        prior: of the load.
        tube_prior: of the liner.
        mirrored: true if the hidden half is taken for the seen one's mirror image.
        targets: splines at the targets.
        of_tube: the parameters that are the liner's own values and the pressure difference.
    """

    def __init__(
        self,
        half: HalfTube,
        targets: Targets,
        prior: LoadPrior,
        tube_prior: TubePrior,
        mirrored: bool = True,
    ) -> None:
        """Builds the model of a wall with targets."""
        self.half, self.prior, self.tube_prior, self.mirrored = half, prior, tube_prior, mirrored
        self._places = TargetPlaces(half, targets)
        self.targets = self._places.basis
        points = 0 if mirrored else len(cut_points(half.grid))
        self._fields = 3 * half.grid.count
        self.of_tube = slice(self._fields, self._fields + TUBE_VALUES)
        self._moved = slice(self.of_tube.stop, self.of_tube.stop + 4 * points)
        self._forced = slice(self._moved.stop, self._moved.stop + 2 * points)

    @property
    def count(self) -> int:
        """Number P of parameters."""
        return self._forced.stop

    def mean(self, difference: Difference, by: LoadMean = USUAL) -> Array:
        """(P,) prior mean of the parameters."""
        mean = np.zeros(self.count)
        mean[self.of_load] = self.prior.mean_mpa(self.half.grid, difference.kpa, by)
        mean[self.of_difference] = difference.kpa * MPA_PER_KPA
        return mean

    def start(self, difference: Difference, mean: LoadMean = USUAL) -> State:
        """The open wall."""
        return State(self.half.mounted, self.mean(difference, mean))

    def spread(self, columns: Array) -> Array:
        """(P, M) prior covariance times columns (P, M), with unit variances of g and pressure difference."""
        fields = columns[: self._fields].reshape(3, self.half.grid.count, -1)
        tube = columns[self.of_tube]
        parts = [
            self.prior.spread(self.half.grid, fields).reshape(self._fields, -1),
            self.tube_prior.covariance @ tube[:-1],
            tube[-1:],
        ]
        if not self.mirrored:
            blocks = self._cut_covariances
            ends = np.split(columns[self._moved.start :], len(blocks))
            parts += [block @ end for block, end in zip(blocks, ends, strict=True)]
        return np.concatenate(parts)

    def variances(self, difference: Difference) -> Array:
        """(P,) factors of the rows of `spread` under a pressure difference."""
        factors = np.ones(self.count)
        factors[self.of_load] = self.prior.scale_mpa(difference.kpa) ** 2
        factors[self.of_difference] = (difference.sigma_kpa * MPA_PER_KPA) ** 2
        return factors

    @property
    def of_load(self) -> slice:
        """The parameters of g."""
        return slice(0, self.half.grid.count)

    def tube_covariance(self, difference: Difference) -> Array:
        """(4, 4) prior covariance of the liner's own values and of the pressure difference."""
        covariance = np.zeros((TUBE_VALUES, TUBE_VALUES))
        covariance[:-1, :-1] = self.tube_prior.covariance
        covariance[-1, -1] = (difference.sigma_kpa * MPA_PER_KPA) ** 2
        return covariance

    @property
    def of_difference(self) -> slice:
        """The parameter that is the pressure difference."""
        return slice(self.of_tube.stop - 1, self.of_tube.stop)

    @cached_property
    def _cut_covariances(self) -> list[Array]:
        return self.prior.cut_covariances(self.half.grid)

    def field(self, parameters: Array, index: int) -> Array:
        """(K,) control values of g (0), of the traction round the wall (1) or along it (2)."""
        count = self.half.grid.count
        return parameters[index * count : (index + 1) * count]

    def tube_values(self, parameters: Array) -> Array:
        """(4,) or (4, …) the liner's own values and the pressure difference."""
        return parameters[self.of_tube]

    def tube(self, parameters: Array) -> MountedTube:
        """The liner."""
        young, thickness, pretension, _ = self.tube_values(parameters)
        return self.half.tube.changed(young, thickness, pretension)

    def load(self, parameters: Array, basis: Basis) -> tuple[Load, Array]:
        """The load at points of the wall, and the contact pressure's derivative by g."""
        contact, by_g = self.prior.contact_mpa(basis.of(self.field(parameters, 0)))
        traction = np.stack([basis.of(self.field(parameters, index)) for index in (1, 2)])
        return Load(float(self.tube_values(parameters)[3]), contact, traction), by_g

    def moved(self, state: State, unknowns: Array, change: Array) -> State:
        """A state moved by its unknowns (n,) and parameters (P,)."""
        control = self.half.moved(state.control, unknowns)
        if not self.mirrored:
            control = control + (self.half.cuts.moved @ change[self._moved]).reshape(control.shape)
        return State(control, state.parameters + change)

    def linearised(self, state: State) -> Linearised:
        """The model about a state."""
        half = self.half.of(self.tube(state.parameters))
        load, by_g = self.load(state.parameters, half.shell.basis)
        work = half.shell.work(state.control)
        tangent = half.tangent(state.control, load)
        forces = self._forces(half, state, work, load, by_g, tangent)
        places = self._places.places_mm(half, state.control)
        by_control = self._places.by_control(half, state.control)
        factors = tangent.factors
        by_parameters = self._followed(factors, forces, by_control)
        by_parameters[:, self.of_tube.start + 1] += self._places.by_thickness(half, state.control)
        residual = half.gathered(work.unbalanced(load)[..., np.newaxis])[:, 0]
        if not self.mirrored:
            residual = residual + self.half.cuts.forced @ state.parameters[self._forced]
        settling = factors.solve(residual)
        settled = places + (by_control @ (half.cuts.free @ settling)).reshape(places.shape)
        return Linearised(state, settled, by_parameters, settling, factors, forces)

    def followed(self, linear: Linearised, by_control: sparse.csr_matrix) -> Array:
        """(Q, P) derivatives by the parameters of what follows the control values of a wall that settles.

        Args:
            linear: the wall.
            by_control: (Q, 4 K) derivatives by its control values.
        """
        return self._followed(linear.factors, linear.forces, by_control)

    def _followed(self, factors: Factors, forces: Forces, by_control: sparse.csr_matrix) -> Array:
        cuts, followed = self.half.cuts, np.empty((by_control.shape[0], self.count))
        # One adjoint solution for each row: far fewer than there are parameters. Some at a time, for memory.
        for first in range(0, len(followed), _AT_ONCE):
            rows = slice(first, first + _AT_ONCE)
            adjoint = factors.solve((by_control[rows] @ cuts.free).toarray().T, transposed=True)
            followed[rows] = forces.transposed(adjoint)
        if not self.mirrored:
            followed[:, self._moved] += (by_control @ cuts.moved).toarray()
        return followed

    def _forces(
        self, half: HalfTube, state: State, work: Work, load: Load, by_g: Array, tangent: Tangent
    ) -> Forces:
        """Derivative of the residual by the parameters."""
        fields = work.units[..., 1:].copy()
        fields[..., 0] *= by_g[:, np.newaxis, np.newaxis]
        others = [self._by_tube(state, work, load)]
        if not self.mirrored:
            others += [-tangent.by_held(half.cuts.moved), half.cuts.forced.toarray()]
        return Forces(half.rows, half.by_fields(fields), np.hstack(others))

    def _by_tube(self, state: State, work: Work, load: Load) -> Array:
        """(n, 4) derivatives of the residual by the liner's values and the pressure difference."""
        before = work.unbalanced(load)
        thickness, pretension = (
            (self._other_tube(state, index).unbalanced(load) - before) / _SMALL for index in (1, 2)
        )
        # As much stiffer as it is tighter, a tube has the same stretch.
        young = -work.resistance - pretension
        return self.half.gathered(np.stack([young, thickness, pretension, work.units[..., 0]], axis=-1))

    def _other_tube(self, state: State, index: int) -> Work:
        """Work with one of the liner's values changed by `_SMALL`."""
        parameters = state.parameters.copy()
        parameters[self.of_tube.start + index] += _SMALL
        return self.half.of(self.tube(parameters)).shell.work(state.control)
