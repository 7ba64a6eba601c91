"""What the errors of image points and of a calibration make of a point's X, Y, Z, for any number of views."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration.adjustment.adjustment import adjust
from grabberd.calibration.adjustment.network import Network
from grabberd.calibration.adjustment.normal_equations import Problem, State, reduced
from grabberd.calibration.adjustment.unknowns import Unknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Propagated:
    """Covariances of the places of T targets that were intersected from their image points.

    Attributes:
        pointing_mm2: (T, 3, 3) from the image points.
        calibration_mm2: (T, 3, 3) from the views' parameters, J·C·Jᵀ.
        influence: (T, 3, 18 V) J, derivatives of the places by all views' `PARAMETERS`.
    """

    pointing_mm2: Array
    calibration_mm2: Array
    influence: Array


def intersect_network(network: Network) -> Array:
    """(T, 3) places of all targets from their image points alone, the views as they are.

    Args:
        network: `target_mm` is where to start from; its σ does not count.

    Raises:
        MeasurementError: as `adjust`: targets that fewer than two views see, for one.
    """
    return adjust(_unknown(network), Unknowns.of(network.views, free=())).xyz_mm


def propagate(network: Network, parameter_covariance: Array) -> Propagated:
    """Covariances of places intersected from image points, at `target_mm`.

    The least squares X(l, p) keep Aᵀ(l − f(X, p)) = 0 (whitened), so dX/dp = −(AᵀA)⁻¹Aᵀ·∂f/∂p.

    Args:
        network: every target in at least two views; its σ_px count, its places' σ do not.
        parameter_covariance: (18 V, 18 V) of the views.

    Raises:
        MeasurementError: targets that fewer than two views see.
    """
    problem = Problem(_unknown(network), Unknowns.of(network.views))
    problem.check_places()
    without = reduced(problem.normals(problem.at(State(network.views, network.target_mm))))
    influence = -without.coupling.transpose(1, 0, 2)
    share = influence @ parameter_covariance @ influence.swapaxes(1, 2)
    return Propagated(without.inverse.transpose(2, 0, 1), share, influence)


def _unknown(network: Network) -> Network:
    return replace(network, target_sigma_mm=np.full(network.target_mm.shape, np.inf))
