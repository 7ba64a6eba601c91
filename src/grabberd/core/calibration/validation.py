"""Validation of a calibration by what took no part in it: held-out targets, and a certified check length.

Targets are held out in spatial blocks, and measured with a calibration from the others. The adjustment takes
its scale from the calibration frame's file alone, so a file that is two per cent too large makes a rig that
is two per cent too large, with perfect residuals. Only another length tells.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from grabberd.core.calibration.adjustment.adjustment import (
    Adjustment,
    AdjustmentSettings,
    adjust,
    intersect_network,
    propagate,
)
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """Held-out targets, measured and compared with their given positions.

    Attributes:
        target: (N,) intp, index of the target.
        block: (N,) intp, block that it was held out with.
        error_mm: (N, 3) measured minus given.
        covariance_mm2: (N, 3, 3) predicted from pointing, calibration and the given position, scaled with
            σ0².
        unchecked: (K,) intp, targets that fewer than two views see or whose position is not given.
        chi2: eᵀC⁻¹e summed over the blocks, the calibration's errors being common to a block.
        freedom: 3 N.
        block_p: (B,) probability of a block's chi2 at least so large if the predicted covariance is true; an
            exact F test, since the σ0 that scales the covariance comes from the other blocks.
    """

    target: NDArray[np.intp]
    block: NDArray[np.intp]
    error_mm: Array
    covariance_mm2: Array
    unchecked: NDArray[np.intp]
    chi2: float
    freedom: int
    block_p: Array

    @property
    def p(self) -> float:
        """Worst block's p times the number of blocks, which are not independent (Bonferroni)."""
        return min(1.0, len(self.block_p) * float(self.block_p.min()))

    @property
    def rmse_mm(self) -> Array:
        """(4,) root mean square errors in X, Y, Z, and combined: √(X² + Y² + Z²)."""
        squares = np.mean(self.error_mm**2, axis=0)
        return np.sqrt(np.append(squares, squares.sum()))


def spatial_blocks(places_mm: Array, count: int) -> NDArray[np.intp]:
    """Divide positions (T, 3) into blocks, (T,), by repeatedly halving the largest along its longest extent.

    Raises:
        MeasurementError: There are fewer positions than blocks.
    """
    if not 1 <= count <= len(places_mm):
        raise MeasurementError(
            f"{len(places_mm)} targets cannot be divided into {count} blocks", "ask for fewer blocks"
        )
    # Neighbours share errors of frame, mirrors and quantisation, and would vouch for each other.
    block = np.zeros(len(places_mm), np.intp)
    for new in range(1, count):
        members = np.flatnonzero(block == np.bincount(block).argmax())
        axis = np.ptp(places_mm[members], axis=0).argmax()
        order = members[np.argsort(places_mm[members, axis], kind="stable")]
        block[order[len(order) // 2 :]] = new
    return block


def cross_validate(
    network: Network, unknowns: Unknowns, blocks: int = 6, settings: AdjustmentSettings | None = None
) -> Validation:
    """Hold the targets out block by block, calibrate with the others, and intersect those held out.

    Only targets seen by two views, with a given position, can be held out.

    Raises:
        MeasurementError: There are fewer such targets than blocks; or as `adjust`, without one of the blocks.
    """
    network = network.starting_from(adjust(network, unknowns, settings).views)
    able = np.isfinite(network.target_sigma_mm).all(axis=1) & (network.sightings > 1)
    target = np.flatnonzero(able)
    block = spatial_blocks(network.target_mm[target], blocks)
    parts = [_held_out(network, unknowns, settings, target[block == one]) for one in range(blocks)]
    order = np.argsort(block, kind="stable")
    return Validation(
        target=target[order],
        block=block[order],
        error_mm=np.concatenate([part.error_mm for part in parts]),
        covariance_mm2=np.concatenate([part.covariance_mm2 for part in parts]),
        unchecked=np.flatnonzero(~able),
        chi2=sum(part.chi2 for part in parts),
        freedom=3 * len(target),
        block_p=np.array([part.p for part in parts]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    error_mm: Array
    covariance_mm2: Array
    chi2: float
    p: float


def _held_out(
    network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None, held: NDArray[np.intp]
) -> _Block:
    inside = np.isin(network.target, held)
    calibrated = adjust(network.select(~inside), unknowns, settings)
    pictures = _only(network.select(inside).starting_from(calibrated.views), held)
    measured = intersect_network(pictures)
    error = measured - pictures.target_mm
    spread = propagate(replace(pictures, target_mm=measured), calibrated.parameter_covariance)
    given = np.eye(3) * pictures.target_sigma_mm[:, np.newaxis] ** 2
    own = calibrated.sigma0**2 * (spread.pointing_mm2 + given)
    joint = _joint(own, spread.influence, calibrated)
    flat = error.ravel()
    chi2 = float(flat @ np.linalg.solve(joint, flat))
    p = float(fdtrc(len(flat), calibrated.freedom, chi2 / len(flat)))
    return _Block(error, own + spread.calibration_mm2, chi2, p)


def _joint(own: Array, influence: Array, calibrated: Adjustment) -> Array:
    """(3 N, 3 N) covariance of a whole block: each target's own, plus the common part of the calibration."""
    count = len(own)
    joint_influence = influence.reshape(3 * count, -1)
    joint: Array = joint_influence @ calibrated.parameter_covariance @ joint_influence.T
    blocks = joint.reshape(count, 3, count, 3)
    blocks[range(count), :, range(count)] += own
    return joint


def _only(network: Network, held: NDArray[np.intp]) -> Network:
    """Network with these targets only, renumbered."""
    return replace(
        network,
        target=np.searchsorted(held, network.target),
        target_mm=network.target_mm[held],
        target_sigma_mm=network.target_sigma_mm[held],
    )


@dataclass(frozen=True, slots=True)
class CheckLength:
    """A certified length between the centres of two targets, by their ids."""

    first: int
    second: int
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True, slots=True)
class MeasuredLength:
    """A check length as the calibration measures it.

    Attributes:
        check: The certified length.
        measured_mm: The distance of the points intersected from both views' images of the targets.
        sigma_mm: σ of the difference: of the images, of the calibration, and of the certificate.
    """

    check: CheckLength
    measured_mm: float
    sigma_mm: float

    @property
    def difference_mm(self) -> float:
        """Measured minus certified."""
        return self.measured_mm - self.check.length_mm

    @property
    def scale_percent(self) -> float:
        """Error of the scale."""
        return 100 * self.difference_mm / self.check.length_mm


def measured_length(
    adjustment: Adjustment, check: CheckLength, first: int, second: int
) -> MeasuredLength | None:
    """Measure a check length; None if not both views have kept both targets.

    Args:
        adjustment: The final adjustment.
        check: The certified length.
        first: Index of its first target.
        second: Index of its second target.
    """
    network = adjustment.network
    wanted = np.array([first, second])
    images = np.isin(network.target, wanted)
    seen = [np.sum(images & (network.target == one)) for one in wanted]
    if min(seen) < len(adjustment.views):
        return None
    chosen = network.select(images)
    pair = replace(
        chosen.starting_from(adjustment.views),
        target=np.searchsorted(np.sort(wanted), chosen.target),
        target_mm=adjustment.xyz_mm[np.sort(wanted)],
        target_sigma_mm=np.full((2, 3), np.inf),
        ids=None,
    )
    places = intersect_network(pair)
    along = places[1] - places[0]
    length = float(np.linalg.norm(along))
    spread = propagate(replace(pair, target_mm=places), adjustment.parameter_covariance)
    unit = along / length
    pointing = float(np.einsum("i,nij,j->", unit, spread.pointing_mm2, unit))
    # The rig's own error is common to both ends: what counts is its influence on their difference.
    influence = unit @ (spread.influence[1] - spread.influence[0])
    rig = float(influence @ adjustment.parameter_covariance @ influence)
    return MeasuredLength(check, length, float(np.sqrt(pointing + rig + check.sigma_mm**2)))
