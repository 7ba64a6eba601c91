"""Significance of parameters: F tests of distortion terms, elimination of those that the pictures do not
show, the covariance of all of them whatever was dropped, and a comparison of two views: is it one lens?

Validation of a calibration by what took no part in it: held-out targets, and a certified check length.

Targets are held out in spatial blocks, and measured with a calibration from the others. The adjustment takes
its scale from the calibration frame's file alone, so a file that is two per cent too large makes a rig that
is two per cent too large, with perfect residuals. Only another length tells.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy.special import fdtrc, stdtr

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.adjustment.adjustment import (
    Adjustment,
    AdjustmentSettings,
    adjust,
    divided,
    intersect_network,
    propagate,
)
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import PARAMETERS, Rig, View, parameter_slopes
from grabberd.errors import MeasurementError

PAIRS = (("b6", "b7"), ("b8", "b9"))
"""Terms of a common cause, which are also tested jointly."""
RADIAL = ("b5", "b4", "b3")
"""Terms of one series, of which only the highest remaining one may be dropped."""


@dataclass(frozen=True, slots=True)
class FTest:
    """Test that parameters are zero, F = (ΔΩ/q)/(Ω/r) with Ω of the model that includes them.

    Attributes:
        round: Number of the adjustment that it belongs to, from 1.
        kind: "single", "joint" or "nested".
        parameters: Names of the unknowns tested.
        statistic: F.
        q: Number of parameters.
        freedom: r, degrees of freedom.
        p: Probability of an F at least so large if they are zero.
        effect_px: Greatest shift of a target's image by them.
        dropped: True if they were dropped because of this test.
    """

    round: int
    kind: str
    parameters: tuple[str, ...]
    statistic: float
    q: int
    freedom: int
    p: float
    effect_px: float
    dropped: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Result of eliminating all insignificant terms.

    Attributes:
        adjustment: Adjustment with the terms that were kept.
        tests: Tests of all rounds in order; those of the last round are all significant.
        dropped: Names in the order in which they were dropped.
    """

    adjustment: Adjustment
    tests: tuple[FTest, ...]
    dropped: tuple[str, ...]


def eliminate(
    network: Network, unknowns: Unknowns, alpha: float = 0.05, settings: AdjustmentSettings | None = None
) -> Elimination:
    """Adjust and drop the least significant distortion term or pair, repeatedly until all are significant.

    A dropped term is zero. A pair, b6 and b7 or b8 and b9, is dropped together if jointly insignificant; a
    single one may be dropped if the pair must stay. Radial terms are dropped from the highest.

    Raises:
        MeasurementError: As `adjust`.
    """
    tests: list[FTest] = []
    dropped: list[str] = []
    for number in count(1):
        adjusted = adjust(network, unknowns, settings)
        of_round = f_tests(adjusted, number)
        weakest = _weakest(of_round, alpha)
        tests += [replace(test, dropped=test is weakest) for test in of_round]
        if weakest is None:
            break
        dropped += weakest.parameters
        network = network.starting_from(_zeroed(adjusted, weakest.parameters))
        unknowns = unknowns.without(weakest.parameters)
    return Elimination(adjusted, tuple(tests), tuple(dropped))


def f_tests(adjusted: Adjustment, number: int = 1) -> tuple[FTest, ...]:
    """Test all adjusted distortion terms in round `number`.

    ΔΩ comes from the covariance, xᵀQ⁻¹x; refitting without the terms gives the same.
    """
    slopes = _slopes(adjusted)
    return tuple(_f_test(adjusted, slopes, number, *group) for group in _groups(adjusted.unknowns.names))


def _f_test(adjusted: Adjustment, slopes: Array, number: int, kind: str, names: tuple[str, ...]) -> FTest:
    index = [adjusted.unknowns.names.index(name) for name in names]
    value, covariance = adjusted.values[index], adjusted.covariance[np.ix_(index, index)]
    sigma = np.sqrt(np.diag(covariance))
    scaled = value / sigma
    explained = float(scaled @ np.linalg.solve(covariance / np.outer(sigma, sigma), scaled))
    statistic = explained / len(index)
    p = float(fdtrc(len(index), adjusted.freedom, statistic))
    effect = _effect_px(adjusted, slopes, index)
    return FTest(number, kind, names, statistic, len(index), adjusted.freedom, p, effect)


def _groups(names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Groups to test: every term by itself, the pairs, and only the highest of the radial series."""
    owners = dict.fromkeys(name.rpartition(".")[0] for name in names)
    for owner in owners:
        labels = {name.rpartition(".")[2] for name in names if name.rpartition(".")[0] == owner}
        for label in sorted(labels):
            if label.startswith("b") and label not in RADIAL:
                yield "single", (f"{owner}.{label}",)
        for pair in PAIRS:
            if labels.issuperset(pair):
                yield "joint", tuple(f"{owner}.{label}" for label in pair)
        top = next((label for label in RADIAL if label in labels), None)
        if top:
            yield "nested", (f"{owner}.{top}",)


def _weakest(tests: Sequence[FTest], alpha: float) -> FTest | None:
    """Least significant test above α, ignoring single terms of a pair that is dropped as a whole."""
    weak = [test for test in tests if test.p > alpha]
    pairs = {name for test in weak if test.kind == "joint" for name in test.parameters}
    able = [test for test in weak if test.kind != "single" or test.parameters[0] not in pairs]
    return max(able, key=lambda test: test.p, default=None)


def _zeroed(adjusted: Adjustment, names: Sequence[str]) -> tuple[View, ...]:
    values = adjusted.values
    values[[adjusted.unknowns.names.index(name) for name in names]] = 0.0
    return adjusted.unknowns.with_values(adjusted.views, values)


def _slopes(adjusted: Adjustment) -> Array:
    """(M, 2, 18) px by which every parameter moves an image point at present: slope times value."""
    network = adjusted.network
    slopes = parameter_slopes(Rig.of_views(adjusted.views), adjusted.xyz_mm)
    values = np.array([view.vector() for view in adjusted.views])
    return slopes[:, network.view, :, network.target] * values[network.view][:, np.newaxis]


def _effect_px(adjusted: Adjustment, slopes: Array, index: Sequence[int]) -> float:
    chosen = np.isin(adjusted.unknowns.number, index)[adjusted.network.view]
    effect = (slopes * chosen[:, np.newaxis]).sum(axis=2)
    return float(np.sqrt((effect * effect).sum(axis=1)).max())


# After local fields σ0 is about .1, and the sum of squares has rounding errors of up to half of the change by
# which `AdjustmentSettings` tells the minimum. A hundred times as much does not alter a covariance.
_SETTLED = AdjustmentSettings(settled=1e-8)


def with_stated_covariance(adjusted: Adjustment, unknowns: Unknowns, doubt: float = 1.0) -> Adjustment:
    """Copy with the covariance of all unknowns, those included that tests have dropped.

    A term that is not significant is not known to be zero: without it the covariance of the others came out
    too small. Nor do residuals smaller than the given σ make these smaller, since positions of targets hardly
    have any redundancy: a σ0 below 1 is no reason to trust the calibration frame's certificate more.

    Args:
        adjusted: The solution, whose views and positions stay as they are.
        unknowns: All unknowns before any test.
        doubt: Probability that the dropped terms are not zero.

    Raises:
        MeasurementError: As `adjust`.
    """
    whole = adjust(adjusted.network.starting_from(adjusted.views), unknowns, _SETTLED)
    without, dropped = _trusted(adjusted), _trusted(whole)
    kept = [whole.unknowns.names.index(name) for name in adjusted.unknowns.names]
    covariance, coupling = np.zeros_like(whole.covariance), np.zeros_like(whole.place_coupling)
    covariance[np.ix_(kept, kept)], coupling[:, :, kept] = without.covariance, without.place_coupling
    pairs = (
        (covariance, dropped.covariance),
        (without.place_covariance_mm2, dropped.place_covariance_mm2),
        (coupling, dropped.place_coupling),
    )
    covariance, places, coupling = ((1.0 - doubt) * zero + doubt * other for zero, other in pairs)
    return replace(
        whole,
        views=adjusted.views,
        xyz_mm=adjusted.xyz_mm,
        covariance=covariance,
        place_covariance_mm2=places,
        place_coupling=coupling,
        sigma0=max(whole.sigma0, 1.0),
    )


def _trusted(adjusted: Adjustment) -> Adjustment:
    """Copy whose covariances small residuals do not reduce."""
    return divided(adjusted, min(adjusted.sigma0, 1.0) ** 2)


COMPARED = (*PARAMETERS[:3], *PARAMETERS[9:])
"""Parameters of the interior; position and orientation always differ."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference of a parameter between two views.

    Attributes:
        parameter: Its name.
        first: Its value in the first view.
        second: Its value in the second view.
        difference: First minus second.
        sigma: Standard deviation of the difference, including the covariance of both.
        z: The difference over its σ.
        p: Two-sided probability of a difference at least so large by chance.
    """

    parameter: str
    first: float
    second: float
    difference: float
    sigma: float
    z: float
    p: float


def compare(adjusted: Adjustment, first: int = 0, second: int = 1) -> tuple[Difference, ...]:
    """Compare parameters of two views, by index, that were adjusted in at least one and are not shared."""
    number, size = adjusted.unknowns.number, len(PARAMETERS)
    vectors = [adjusted.views[index].vector().tolist() for index in (first, second)]
    covariance = adjusted.parameter_covariance
    differences = []
    for index, (name, one, other) in enumerate(zip(PARAMETERS, *vectors, strict=True)):
        if name not in COMPARED or number[first, index] == number[second, index]:
            continue
        at, beside = first * size + index, second * size + index
        variance = covariance[at, at] + covariance[beside, beside] - 2 * covariance[at, beside]
        sigma = float(np.sqrt(variance))
        z = (one - other) / sigma
        p = 2.0 * float(stdtr(adjusted.freedom, -abs(z)))
        differences.append(Difference(name, one, other, one - other, sigma, z, p))
    return tuple(differences)


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

    target: Indices
    block: Indices
    error_mm: Array
    covariance_mm2: Array
    unchecked: Indices
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


def spatial_blocks(places_mm: Array, count: int) -> Indices:
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
    network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None, held: Indices
) -> _Block:
    inside = np.isin(network.target, held)
    calibrated = adjust(network.select(~inside), unknowns, settings)
    pictures = network.select(inside).starting_from(calibrated.views).of_targets(held)
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
        chosen.starting_from(adjustment.views).of_targets(np.sort(wanted)),
        target_mm=adjustment.xyz_mm[np.sort(wanted)],
        target_sigma_mm=np.full((2, 3), np.inf),
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
