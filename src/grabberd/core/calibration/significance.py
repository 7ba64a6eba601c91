"""Significance of parameters: F tests of distortion terms, elimination of those that the pictures do not
show, the covariance of all of them whatever was dropped, and a comparison of two views: is it one lens?
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr

from grabberd.core.calibration.adjustment.adjustment import Adjustment, AdjustmentSettings, adjust, divided
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import PARAMETERS, Rig, View, parameter_slopes

Array = NDArray[np.float64]

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


def with_stated_covariance(adjusted: Adjustment, unknowns: Unknowns) -> Adjustment:
    """Copy with the covariance of all unknowns, those included that tests have dropped.

    A term that is not significant is not known to be zero: without it the covariance of the others came out
    too small. Nor do residuals smaller than the given σ make these smaller, since positions of targets hardly
    have any redundancy: a σ0 below 1 is no reason to trust the calibration frame's certificate more.

    Args:
        adjusted: The solution, whose views and positions stay as they are.
        unknowns: All unknowns before any test.

    Raises:
        MeasurementError: As `adjust`.
    """
    whole = adjust(adjusted.network.starting_from(adjusted.views), unknowns, _SETTLED)
    trusted = min(whole.sigma0, 1.0) ** 2
    whole = divided(whole, trusted)
    return replace(whole, views=adjusted.views, xyz_mm=adjusted.xyz_mm, sigma0=max(whole.sigma0, 1.0))


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
