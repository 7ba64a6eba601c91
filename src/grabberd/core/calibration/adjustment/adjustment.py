"""Bundle adjustment: least squares for the views' parameters and the targets' positions (paper 3.6).

Levenberg–Marquardt with analytic derivatives. Positions are eliminated target by target, so the cost grows
linearly with the number of targets and with the cube of only the few parameters; the full covariance comes
from the same elimination, and so does its propagation to X, Y, Z of any points, for any number of views.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.calibration.adjustment.normal_equations import (
    Linear,
    Normals,
    Problem,
    Reduced,
    State,
    reduced,
)
from grabberd.core.geometry import PARAMETERS, View
from grabberd.errors import MeasurementError, RankDeficient

_HINT_START = "check the rig's nominal geometry, the calibration frame's file and which target is which"
_HINT_POOR = (
    "a start that is nearer helps: focal length and poses from `with_starting_values`, or from an adjustment "
    "that holds the other parameters; if that does not help either, check which target is which"
)
_LEAST_DAMPING, _MOST_DAMPING = 1e-12, 1e12
_EXACT = 1e-6
"""σ0² below which pictures count as free of error, and iterating gains nothing."""
_ROUGHLY = 1e-3
"""Relative change that ends the iteration without polynomials, which is only to be started from."""
_PROGRESS = 0.01
"""Share by which the sum of squares has to fall to be worth as many steps again; near the minimum, where it
falls no more, the steps have to become shorter."""
_BY_ROUNDING = 1e-8
"""Share of the sum of squares that a step may still promise where none lowers it: rounding hides the rest of
the way, of some thousandths of the unknowns' σ."""
_POLYNOMIAL = PARAMETERS[9:]


@dataclass(frozen=True, slots=True)
class AdjustmentSettings:
    """Criteria of convergence of an adjustment.

    Attributes:
        settled: Relative change of the sum of squares by the next step below which it has converged: the step
            is then that share of the unknowns' σ, squared and for each degree of freedom.
        most_steps: Number of steps after which the start counts as poor. The polynomials b1…b9 are then held
            until the other unknowns have converged; from there on it is given up only where so many steps
            neither lower the sum of squares by a hundredth nor halve what the next one promises.
        damping: Initial Marquardt damping.
    """

    settled: float = 1e-10
    most_steps: int = 60
    damping: float = 1e-6


class Minimum(NamedTuple):
    """End of the iteration: the state, the network linearised there, its normals, and the steps taken."""

    state: State
    linear: Linear
    normals: Normals
    steps: int


class _Step(NamedTuple):
    """Changes of the unknowns (U,) and positions (3, P), and the decrease of the squares they promise."""

    unknowns: Array
    places: Array
    promise: float


class _Lower(NamedTuple):
    """A state with a lower sum of squares, the network there, the next damping, and what was promised."""

    state: State
    linear: Linear
    damping: float
    promise: float


def minimise(problem: Problem, settings: AdjustmentSettings) -> Minimum:
    """Iterate to the least-squares state.

    Raises:
        MeasurementError: The start lies behind a camera, or the iteration does not converge.
        RankDeficient: No image point depends on one of the unknowns.
    """
    if not np.isfinite(problem.at(problem.start).omega):
        raise MeasurementError("the adjustment starts with targets behind a camera", _HINT_START)
    found, unfinished = _descend(problem, problem.start, settings)
    if unfinished:
        start, before = _nearer_start(problem, found, settings)
        found, unfinished = _descend(problem, start, settings, patient=True)
        found = found._replace(steps=before + found.steps)
    if unfinished:
        sigma0 = (found.linear.omega / problem.freedom) ** 0.5
        raise MeasurementError(
            f"the adjustment has not converged after {found.steps} steps; "
            f"sigma 0 is {sigma0:.3g}{unfinished}",
            _HINT_POOR,
        )
    return found


def _nearer_start(problem: Problem, found: Minimum, settings: AdjustmentSettings) -> tuple[State, int]:
    """State to go on from after a descent that came to no end, and the steps taken until there."""
    # From far away the polynomials take over what focal length and pose lack, and the way back leads along
    # narrow valleys; while they are held, the others come near in a few steps.
    names = [name for name in problem.unknowns.names if name.partition(".")[2][:2] in _POLYNOMIAL]
    coarse = Problem(problem.network, problem.unknowns.without(names))
    if not names or not len(coarse.unknowns):
        return found.state, found.steps
    near, lost = _descend(coarse, coarse.start, replace(settings, settled=_ROUGHLY))
    return found.state if lost else near.state, found.steps + near.steps


def _descend(
    problem: Problem, state: State, settings: AdjustmentSettings, patient: bool = False
) -> tuple[Minimum, str]:
    """Iterate from a state; why it ended before the minimum, empty if it did not.

    Args:
        problem: The network and its unknowns.
        state: The start, before all cameras.
        settings: Criteria of convergence.
        patient: True to go on beyond `most_steps` for as long as it pays.
    """
    damping, linear, steps = settings.damping, problem.at(state), 0
    goal, deadline = (np.inf, np.inf), settings.most_steps
    while True:
        normals = problem.normals(linear)
        here = Minimum(state, linear, normals, steps)
        trial = _lower(problem, here, damping, settings.settled)
        if trial is None:
            return here, ""
        if isinstance(trial, float):
            if trial <= _BY_ROUNDING:
                return here, ""
            return here, f": no step lowers it, though the next promises {trial:.1e} of its square"
        if patient and (linear.omega <= goal[0] or trial.promise <= goal[1]):
            goal = (1.0 - _PROGRESS) * linear.omega, 0.5 * trial.promise
            deadline = steps + settings.most_steps
        if steps >= deadline:
            slow = f": the last {settings.most_steps} neither lowered its square by 1 % nor came nearer"
            return here, slow
        state, linear, damping = trial.state, trial.linear, trial.damping
        steps += 1


def _step(normals: Normals, scale: Array, damping: float) -> _Step:
    without = reduced(normals, damping)
    damped = without.matrix * scale * scale[:, np.newaxis]
    damped.ravel()[:: len(scale) + 1] += damping
    unknowns = scale * np.linalg.solve(damped, scale * without.right)
    places = np.einsum("klp,lp->kp", without.inverse, normals.own_right) - without.coupling @ unknowns
    promise = float(unknowns @ normals.right + np.vdot(places, normals.own_right))
    return _Step(unknowns, places, promise)


def _scale(problem: Problem, normals: Normals) -> Array:
    """(U,) scale that gives the normal matrix a unit diagonal."""
    diagonal = np.diag(normals.matrix)
    if not (diagonal > 0).all():
        names = [
            name for name, weight in zip(problem.unknowns.names, diagonal, strict=True) if not weight > 0
        ]
        raise RankDeficient(
            f"no image point depends on {', '.join(names)}",
            "hold these parameters, or take more pictures with the view that they belong to",
            names,
        )
    return 1.0 / np.sqrt(diagonal)


def _lower(problem: Problem, here: Minimum, damping: float, settled: float) -> _Lower | float | None:
    """The step to a lower sum of squares.

    None at the minimum; where no step lowers the sum, the share of it that the next one promises.
    """
    state, linear, normals, _ = here
    scale = _scale(problem, normals)
    enough = settled * max(linear.omega, _EXACT * problem.freedom)
    while True:
        step = _step(normals, scale, damping)
        # Damped steps promise little anywhere along a narrow valley; only a free one tells the minimum.
        if step.promise <= enough and _step(normals, scale, _LEAST_DAMPING).promise <= enough:
            return None
        trial = problem.moved(state, step.unknowns, step.places)
        there = problem.at(trial)
        if there.omega < linear.omega:
            break
        # By little: pictures that are known far better than the frame make a valley that only lightly
        # damped steps follow, and each return from a strong damping takes several.
        damping *= 5
        if damping > _MOST_DAMPING:
            return _step(normals, scale, _LEAST_DAMPING).promise / linear.omega
    # Trust the linear model more, as is or less, by how much of its promise was kept.
    kept = (linear.omega - there.omega) / step.promise
    damping *= 0.1 if kept > 0.75 else 1.0 if kept > 0.25 else 3.0
    return _Lower(trial, there, max(damping, _LEAST_DAMPING), step.promise)


_MOST_INFLATION = 1e13
"""Greatest inflation of a variance by the other unknowns; beyond it the normal matrix is singular to double
precision."""


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """Least-squares solution of a network.

    Attributes:
        network: The input.
        unknowns: The parameters that were estimated.
        views: The adjusted views.
        xyz_mm: (T, 3) the adjusted positions of the targets.
        covariance: (U, U) of the unknowns, scaled with the estimated variance of unit weight.
        place_covariance_mm2: (T, 3, 3) of the positions, likewise; infinite for a target that no view saw and
            of which nothing is known.
        place_coupling: (T, 3, U) covariance of positions and unknowns, likewise.
        residual_px: (M, 2) observed minus computed.
        redundancy: (M, 2) share of an observation's error that shows in its residual.
        sigma0: Standard deviation of unit weight: 1 if the given σ are true.
        freedom: Degrees of freedom.
        sum_of_squares: Sum of all squared whitened residuals, those of positions included.
        steps: Number of iterations.
    """

    network: Network
    unknowns: Unknowns
    views: tuple[View, ...]
    xyz_mm: Array
    covariance: Array
    place_covariance_mm2: Array
    place_coupling: Array
    residual_px: Array
    redundancy: Array
    sigma0: float
    freedom: int
    sum_of_squares: float
    steps: int

    @property
    def values(self) -> Array:
        """(U,) adjusted values of the unknowns."""
        return self.unknowns.values(self.views)

    @property
    def sigma(self) -> Array:
        """(U,) standard deviations of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """(U, U) correlations of the unknowns."""
        return self.covariance / np.outer(self.sigma, self.sigma)

    @property
    def sigma0_px(self) -> float:
        """Standard deviation of an image coordinate of average weight."""
        return self.sigma0 / float(np.sqrt(np.mean(self.network.sigma_px**-2.0)))

    @property
    def sigma0_images(self) -> float:
        """The same of the image points alone, by the share of their errors that shows in their residuals.

        Most of all redundancy is that of a calibration frame's certified positions, if pictures are known far
        better: σ0 then says how good the certificate is.
        """
        whitened = self.residual_px / self.network.sigma_px
        share = float(self.redundancy.sum())
        return float(np.sqrt((whitened**2).sum() / share)) if share > 0.0 else self.sigma0

    @property
    def standardised(self) -> Array:
        """(M, 2) residuals over their own estimated σ; NaN for an uncontrolled observation."""
        controlled = np.where(self.redundancy > 1e-9, self.redundancy, np.nan)
        return self.residual_px / (self.sigma0 * self.network.sigma_px * np.sqrt(controlled))

    @property
    def parameter_covariance(self) -> Array:
        """(18 V, 18 V) covariance of all views' `PARAMETERS`, zero where held."""
        slopes = self.unknowns.derivatives(self.views)
        return slopes @ self.covariance @ slopes.T


def adjust(network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None = None) -> Adjustment:
    """Adjust a network by least squares.

    Raises:
        MeasurementError: There are fewer observations than unknowns, targets seen too rarely, a start behind
            a camera, or no convergence; the message says which.
        RankDeficient: The image points do not determine the unknowns separately.
    """
    problem = Problem(network, unknowns)
    problem.check()
    return _result(problem, minimise(problem, settings or AdjustmentSettings()))


def _result(problem: Problem, minimum: Minimum) -> Adjustment:
    linear, without = minimum.linear, reduced(minimum.normals)
    cofactor = _cofactor(problem, minimum, without)
    variance = linear.omega / problem.freedom
    coupling, place = _places(problem, without, cofactor)
    return Adjustment(
        network=problem.network,
        unknowns=problem.unknowns,
        views=minimum.state.views,
        xyz_mm=minimum.state.xyz_mm,
        covariance=variance * cofactor,
        place_covariance_mm2=variance * place,
        place_coupling=variance * coupling,
        residual_px=problem.residuals_px(linear),
        redundancy=_redundancy(problem, linear, without, cofactor),
        sigma0=variance**0.5,
        freedom=problem.freedom,
        sum_of_squares=linear.omega,
        steps=minimum.steps,
    )


def _cofactor(problem: Problem, minimum: Minimum, without: Reduced) -> Array:
    # Inverted with a unit diagonal, because the parameters' units span twenty decades.
    scale = 1.0 / np.sqrt(np.diag(minimum.normals.matrix))
    try:
        inverse = np.asarray(np.linalg.inv(without.matrix * scale * scale[:, np.newaxis]), np.float64)
    except np.linalg.LinAlgError:
        raise _singular(problem.unknowns.names) from None
    # Where parameters are hardly told apart, rounding makes the two halves differ by much more than itself.
    inverse = (inverse + inverse.T) / 2
    inflation = np.diag(inverse)
    loose = ~((inflation > 0) & (inflation < _MOST_INFLATION))
    if loose.any():
        raise _singular([problem.unknowns.names[index] for index in np.flatnonzero(loose)])
    return inverse * np.outer(scale, scale)


def _singular(names: tuple[str, ...] | list[str]) -> RankDeficient:
    return RankDeficient(
        f"the image points do not determine {', '.join(names)} together",
        "hold some of them, or use a calibration frame with more depth",
        names,
    )


def _places(problem: Problem, without: Reduced, cofactor: Array) -> tuple[Array, Array]:
    """Cofactors of positions and unknowns (T, 3, U), and of the positions (T, 3, 3)."""
    network, moving = problem.network, problem.moving
    coupling = np.zeros((*network.target_mm.shape, len(problem.unknowns)))
    place = np.zeros((*network.target_mm.shape, 3))
    place[:, range(3), range(3)] = network.target_sigma_mm**2
    follows = without.coupling.transpose(1, 0, 2)
    coupling[moving] = -(follows @ cofactor)
    free = problem.loose[:, np.newaxis] & problem.loose
    own: Array = np.where(free, without.inverse, 0.0).transpose(2, 0, 1)
    place[moving] = own - coupling[moving] @ follows.swapaxes(1, 2)
    return coupling, place


def _redundancy(problem: Problem, linear: Linear, without: Reduced, cofactor: Array) -> Array:
    """(M, 2) 1 − A·Q·Aᵀ of each whitened observation, with and without the part its position absorbs."""
    network, moving = problem.network, problem.moving
    rows = problem.whitened_rows(linear)
    used = np.zeros(rows.shape[:3])
    if len(moving):
        places = problem.by_place(linear)
        rows[:, :, moving] -= np.einsum("cvkp,kpu->cvpu", places, without.coupling)
        used[:, :, moving] = np.einsum("cvkp,klp,cvlp->cvp", places, without.inverse, places, optimize=True)
    used += ((rows @ cofactor) * rows).sum(axis=3)
    return 1.0 - used[:, network.view, network.target].T


@dataclass(frozen=True, slots=True, eq=False)
class Propagated:
    """Covariances of T positions intersected from image points.

    Attributes:
        pointing_mm2: (T, 3, 3) from the image points.
        calibration_mm2: (T, 3, 3) from the views' parameters, J·C·Jᵀ.
        influence: (T, 3, 18 V) J, derivatives of the positions by all views' `PARAMETERS`.
    """

    pointing_mm2: Array
    calibration_mm2: Array
    influence: Array


def divided(adjustment: Adjustment, variance: float) -> Adjustment:
    """Copy with all covariances divided by a variance."""
    return replace(
        adjustment,
        covariance=adjustment.covariance / variance,
        place_covariance_mm2=adjustment.place_covariance_mm2 / variance,
        place_coupling=adjustment.place_coupling / variance,
    )


def intersect_network(network: Network) -> Array:
    """Intersect all targets from their image points alone, with the views held: (T, 3) positions.

    Args:
        network: `target_mm` gives start values; its σ is ignored.

    Raises:
        MeasurementError: As `adjust`, e.g. for targets that fewer than two views see.
    """
    return adjust(_unknown(network), Unknowns.of(network.views, free=())).xyz_mm


def propagate(network: Network, parameter_covariance: Array) -> Propagated:
    """Compute the covariances of positions intersected from image points, at `target_mm`.

    The solution X(l, p) satisfies Aᵀ(l − f(X, p)) = 0 (whitened), so dX/dp = −(AᵀA)⁻¹Aᵀ·∂f/∂p.

    Args:
        network: Every target in at least two views; `sigma_px` is used, the positions' σ is not.
        parameter_covariance: (18 V, 18 V) of the views.

    Raises:
        MeasurementError: A target is seen by fewer than two views.
    """
    problem = Problem(_unknown(network), Unknowns.of(network.views))
    problem.check_places()
    without = reduced(problem.normals(problem.at(State(network.views, network.target_mm))))
    influence = -without.coupling.transpose(1, 0, 2)
    share = influence @ parameter_covariance @ influence.swapaxes(1, 2)
    return Propagated(without.inverse.transpose(2, 0, 1), share, influence)


def _unknown(network: Network) -> Network:
    return replace(network, target_sigma_mm=np.full(network.target_mm.shape, np.inf))
