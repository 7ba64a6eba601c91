"""Bundle adjustment: least squares for the views' parameters and the targets' positions (paper 3.6).

Levenberg–Marquardt with analytic derivatives. Positions are eliminated target by target, so the cost grows
linearly with the number of targets and with the cube of only the few parameters; the full covariance comes
from the same elimination.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.levenberg_marquardt import AdjustmentSettings, Minimum, minimise
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.adjustment.normal_equations import Linear, Problem, Reduced, reduced
from grabberd.core.calibration.adjustment.unknowns import Unknowns
from grabberd.core.geometry import View
from grabberd.errors import RankDeficient

Array = NDArray[np.float64]

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
    cofactor: Array = inverse * np.outer(scale, scale)
    return cofactor


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
