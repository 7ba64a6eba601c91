"""The bundle adjustment: least squares for the views' parameters and the targets' places (paper 3.6).

Levenberg–Marquardt on analytic derivatives. The places are eliminated target by target, so the cost grows
with the number of targets and with the cube of the few parameters only; the full covariance comes from the
same elimination.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration.network import Network
from grabberd.calibration.normals import Design, Normals, Problem, State
from grabberd.calibration.unknowns import Unknowns
from grabberd.errors import MeasurementError
from grabberd.geometry import View

Array = NDArray[np.float64]

_LEAST_DAMPING = 1e-12
_HINT_START = "check the rig's nominal geometry, the calibration frame's file and which target is which"


@dataclass(frozen=True, slots=True)
class AdjustmentSettings:
    """When an adjustment has converged, and when it is given up.

    Attributes:
        settled: converged where the last step changed the sum of squares by less than this share.
        most_steps: after so many it has not converged.
        damping: Marquardt's, to begin with.
    """

    settled: float = 1e-10
    most_steps: int = 60
    damping: float = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """What least squares make of a network.

    Attributes:
        network: what was given; `unknowns`: what was sought.
        views: the views as adjusted.
        xyz_mm: (T, 3) the targets' places as adjusted.
        covariance: (U, U) of the unknowns, scaled with the estimated variance of unit weight.
        place_covariance_mm2: (T, 3, 3) of the places, likewise; `place_coupling`: (T, 3, U) of both.
        residual_px: (M, 2) observed minus computed.
        redundancy: (M, 2) share of an observation's error that its residual shows.
        sigma0: standard deviation of unit weight: 1 where the given σ are true.
        freedom: degrees of freedom.
        sum_of_squares: of all whitened residuals, places' included.
        steps: of the iteration.
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
    def sigma0_px(self) -> float:
        """Standard deviation of an image coordinate of mean weight."""
        return self.sigma0 / float(np.sqrt(np.mean(self.network.sigma_px**-2.0)))

    @property
    def parameter_covariance(self) -> Array:
        """(18 V, 18 V) of all views' `PARAMETERS`, zero where held."""
        selection = self.unknowns.selection
        full: Array = selection @ self.covariance @ selection.T
        return full


def adjust(network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None = None) -> Adjustment:
    """The least squares solution of a network.

    Args:
        network: image points, targets, and the views to start from.
        unknowns: which parameters are sought.
        settings: when it has converged.

    Raises:
        MeasurementError: fewer observations than unknowns, a start behind a camera, a singular system, or no
            convergence; the message says which.
    """
    settings = settings or AdjustmentSettings()
    problem = Problem(network, unknowns)
    if problem.freedom < 1:
        raise MeasurementError(
            f"{len(network)} image points do not determine {len(unknowns)} parameters",
            "more targets have to be seen, or more parameters held",
        )
    state, steps = _converged(problem, settings)
    return _result(problem, state, steps)


def _converged(problem: Problem, settings: AdjustmentSettings) -> tuple[State, int]:
    state, damping = problem.start, settings.damping
    omega = _omega(problem, state)
    if not np.isfinite(omega):
        raise MeasurementError("the adjustment starts with targets behind a camera", _HINT_START)
    for step in range(1, settings.most_steps + 1):
        normals = problem.normals(state)
        while True:
            trial, promised = _moved(problem, state, normals, damping)
            after = _omega(problem, trial)
            if after <= omega:
                break
            if promised <= settings.settled * omega:
                return state, step
            damping = max(10 * damping, 1e-6)
            if damping > 1e12:
                raise _no_convergence(step, omega, problem)
        gained, omega, state = omega - after, after, trial
        damping = max(damping / 10, _LEAST_DAMPING)
        if gained <= settings.settled * omega:
            return state, step
    raise _no_convergence(settings.most_steps, omega, problem)


def _no_convergence(steps: int, omega: float, problem: Problem) -> MeasurementError:
    sigma0 = (omega / problem.freedom) ** 0.5
    return MeasurementError(
        f"the adjustment has not converged after {steps} steps; sigma 0 is {sigma0:.3g}", _HINT_START
    )


def _omega(problem: Problem, state: State) -> float:
    image, offset = problem.misfit(state)
    omega = float((image * image).sum() + (offset * offset).sum())
    return omega if np.isfinite(omega) else np.inf


def _moved(problem: Problem, state: State, normals: Normals, damping: float) -> tuple[State, float]:
    """The state after a damped step, and by how much the linear model promises to lessen the squares."""
    own = normals.own.copy()
    diagonal = np.einsum("tkk->tk", own)
    diagonal *= 1 + damping
    coupling, offset = _eliminated(own, normals)
    reduced = normals.matrix - np.einsum("tku,tkw->uw", normals.cross, coupling)
    right = normals.right - np.einsum("tku,tk->u", normals.cross, offset)
    scale = 1.0 / np.sqrt(np.diag(normals.matrix))
    damped = reduced * scale * scale[:, np.newaxis] + damping * np.eye(len(scale))
    try:
        step = scale * np.linalg.solve(damped, scale * right)
    except np.linalg.LinAlgError:
        raise _singular(problem) from None
    places = offset - coupling @ step
    promised = float(step @ normals.right + (places * normals.own_right).sum())
    views = problem.unknowns.moved(state.views, step)
    return State(views, state.xyz_mm + np.where(problem.loose, places, 0.0)), promised


def _eliminated(own: Array, normals: Normals) -> tuple[Array, Array]:
    """own⁻¹·cross (T, 3, U) and own⁻¹·right (T, 3)."""
    inverse = np.linalg.inv(own)
    return inverse @ normals.cross, (inverse @ normals.own_right[:, :, np.newaxis])[:, :, 0]


def _singular(problem: Problem) -> MeasurementError:
    return MeasurementError(
        f"the picture does not determine {', '.join(problem.unknowns.names)} together",
        "hold some of them, or use a calibration frame with more depth",
    )


def _result(problem: Problem, state: State, steps: int) -> Adjustment:
    network, normals, design = problem.network, problem.normals(state), problem.design(state)
    inverse = np.linalg.inv(normals.own)
    coupling = inverse @ normals.cross
    cofactor = _cofactor(problem, normals, coupling)
    free = problem.loose[:, :, np.newaxis] & problem.loose[:, np.newaxis]
    place: Array = np.where(free, inverse, 0.0) + coupling @ cofactor @ coupling.swapaxes(1, 2)
    omega = _omega(problem, state)
    variance = omega / problem.freedom
    image, _ = problem.misfit(state)
    weight = problem.weight[:, network.view, network.target].T
    return Adjustment(
        network=network,
        unknowns=problem.unknowns,
        views=state.views,
        xyz_mm=state.xyz_mm,
        covariance=variance * cofactor,
        place_covariance_mm2=variance * place,
        place_coupling=-variance * (coupling @ cofactor),
        residual_px=image[:, network.view, network.target].T / weight,
        redundancy=_redundancy(problem, design, np.asarray(inverse, np.float64), coupling, cofactor),
        sigma0=variance**0.5,
        freedom=problem.freedom,
        sum_of_squares=omega,
        steps=steps,
    )


def _cofactor(problem: Problem, normals: Normals, coupling: Array) -> Array:
    reduced = normals.matrix - np.einsum("tku,tkw->uw", normals.cross, coupling)
    scale = 1.0 / np.sqrt(np.diag(normals.matrix))
    try:
        inverse: Array = np.linalg.inv(reduced * scale * scale[:, np.newaxis])
    except np.linalg.LinAlgError:
        raise _singular(problem) from None
    return inverse * scale * scale[:, np.newaxis]


def _redundancy(problem: Problem, design: Design, inverse: Array, coupling: Array, cofactor: Array) -> Array:
    """1 − A·Q·Aᵀ of each whitened observation: the row less what its place absorbs, and the place's own."""
    network = problem.network
    places = design.places[:, network.view, :, network.target]
    blocks = problem.selection.reshape(len(network.views), -1, len(problem.unknowns))
    rows = design.parameters[:, network.view, :, network.target]
    rows = (rows[:, :, np.newaxis] @ blocks[network.view][:, np.newaxis])[:, :, 0]
    rows = rows - (places[:, :, np.newaxis] @ coupling[network.target][:, np.newaxis])[:, :, 0]
    used = ((rows @ cofactor) * rows).sum(axis=2)
    used += ((places[:, :, np.newaxis] @ inverse[network.target][:, np.newaxis])[:, :, 0] * places).sum(
        axis=2
    )
    redundancy: Array = (1.0 - used).T
    return redundancy
