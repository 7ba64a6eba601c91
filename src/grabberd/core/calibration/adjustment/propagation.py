"""Propagation of errors of image points and of a calibration to X, Y, Z, for any number of views."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.adjustment.normal_equations import Problem, State, reduced
from grabberd.core.calibration.adjustment.unknowns import Unknowns

Array = NDArray[np.float64]


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
