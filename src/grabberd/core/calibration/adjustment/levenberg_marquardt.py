"""Levenberg–Marquardt iteration to the least-squares solution of a network."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.normal_equations import Linear, Normals, Problem, State, reduced
from grabberd.errors import MeasurementError, RankDeficient

Array = NDArray[np.float64]

_HINT_START = "check the rig's nominal geometry, the calibration frame's file and which target is which"
_LEAST_DAMPING, _MOST_DAMPING = 1e-12, 1e12
_EXACT = 1e-6
"""σ0² below which pictures count as free of error, and iterating gains nothing."""


@dataclass(frozen=True, slots=True)
class AdjustmentSettings:
    """Criteria of convergence of an adjustment.

    Attributes:
        settled: Relative change of the sum of squares by the next step below which it has converged.
        most_steps: Number of steps after which it is given up.
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


def minimise(problem: Problem, settings: AdjustmentSettings) -> Minimum:
    """Iterate to the least-squares state.

    Raises:
        MeasurementError: The start lies behind a camera, or the iteration does not converge.
        RankDeficient: No image point depends on one of the unknowns.
    """
    state, damping = problem.start, settings.damping
    linear = problem.at(state)
    if not np.isfinite(linear.omega):
        raise MeasurementError("the adjustment starts with targets behind a camera", _HINT_START)
    for steps in range(settings.most_steps + 1):
        normals = problem.normals(linear)
        scale = _scale(problem, normals)
        enough = settings.settled * max(linear.omega, _EXACT * problem.freedom)
        while True:
            step = _step(normals, scale, damping)
            # Damped steps promise little anywhere along a narrow valley; only a free one tells the minimum.
            if step.promise <= enough and _step(normals, scale, _LEAST_DAMPING).promise <= enough:
                return Minimum(state, linear, normals, steps)
            trial = problem.moved(state, step.unknowns, step.places)
            there = problem.at(trial)
            if there.omega < linear.omega:
                break
            # By little: pictures that are known far better than the frame make a valley that only lightly
            # damped steps follow, and each return from a strong damping takes several.
            damping *= 5
            if damping > _MOST_DAMPING:
                promise = _step(normals, scale, _LEAST_DAMPING).promise / linear.omega
                stuck = f": no step lowers it, though the next promises {promise:.1e} of its square"
                raise _no_convergence(steps, linear.omega, problem, stuck)
        # Trust the linear model more, as is or less, by how much of its promise was kept.
        kept = (linear.omega - there.omega) / step.promise
        damping *= 0.1 if kept > 0.75 else 1.0 if kept > 0.25 else 3.0
        state, linear, damping = trial, there, max(damping, _LEAST_DAMPING)
    raise _no_convergence(settings.most_steps, linear.omega, problem)


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


def _no_convergence(steps: int, omega: float, problem: Problem, stuck: str = "") -> MeasurementError:
    sigma0 = (omega / problem.freedom) ** 0.5
    return MeasurementError(
        f"the adjustment has not converged after {steps} steps; sigma 0 is {sigma0:.3g}{stuck}", _HINT_START
    )
