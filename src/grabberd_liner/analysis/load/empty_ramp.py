"""The liner's own values, also as quantities of the field, from a slow ramp of the pressure difference with
the empty liner.

Nothing touches the inner face, so the pressure difference alone flattens the wall, by as much as its
stiffness lets it: what a capture with a teat cannot tell apart, modulus and contact pressure, is told here.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.collapse import Collapse, RampLevel, row_heights
from grabberd_liner.analysis.load.load_fit import MISFIT_ALARM
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.ramp_fit import TUBE_VALUES, EmptyWall, Ramp, fit_ramp
from grabberd_liner.analysis.load.wall_model import TubePrior
from grabberd_liner.analysis.wall.material import Material

LEAST_LEVELS = 4
"""Buckled levels that are needed; fewer cannot contradict each other."""
_MOST_BUCKLED, _MOST_OPEN = 7, 2
"""Levels that are fitted: more add time, but no knowledge, for what errs alike in all of them stays."""
_BUCKLED, _OPEN, _TOUCHING = 0.06, 0.02, 0.03
"""Of the radius: fall of the wall from which it counts as buckled, to which as open; distance of touch."""
_PART = 0.5
"""Of the least pressure difference that buckles: below it an open wall says nothing."""
_SIGMA_STIFFNESS = 0.1
"""σ of ln E t³ above which the ramp would not help a map of the pressure."""
_LEAST_SIGMA_KPA = 1e-3
LAW_SIGMA = {"E_mpa": 0.03, "wall_mm": 0.008, "F0_n": 0.09}
"""σ of ln E, ln t and ln F0 for what the rubber's law and the liner's shape may differ from the model's.

On six solved liners E t³ errs by .03 RMS and F0 by .1, most with a stiffening law and with a taper of 1 %:
more than noise and what was known before explain. None of it is in the modulus alone.
"""
_MODEL_MM, _MODEL_ROUND_MM, _MODEL_ALONG_MM = 0.02, 8.0, 20.0
"""How far the shell is from a solid of finer elements where it folds, and over what length that changes."""


@dataclass(frozen=True, slots=True, eq=False)
class LinerValues:
    """The liner's own values, from a ramp.

    Attributes:
        E_mpa, wall_mm, F0_n: Young's modulus, thickness and pretension of the mounted liner.
        covariance: (3, 3) of their logarithms; `own`: (3, 3) its part by the noise of this ramp.
        used: indices of the levels that were fitted.
        difference_kpa: of those levels, after the fit.
        misfit: of their points, by coordinate; about 1 is usual, above 2 refused.
        unused: level by level why it was not fitted; empty where it was.
    """

    E_mpa: float
    wall_mm: float
    F0_n: float
    covariance: Array
    own: Array
    used: tuple[int, ...]
    difference_kpa: Estimate
    misfit: float
    unused: tuple[str, ...]

    @property
    def sigma(self) -> Array:
        """(3,) standard deviations of ln E, ln t, ln F0."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def common_sigma(self) -> Array:
        """(4,) part of σ that other ramps share: of ln E, ln t, ln F0 and ln E t³."""
        variances = (*np.diagonal(self.covariance), _stiffness_sigma(self.covariance) ** 2)
        own = (*np.diagonal(self.own), _stiffness_sigma(self.own) ** 2)
        return np.sqrt(np.maximum(np.subtract(variances, own), 0.0))

    @property
    def stiffness_n_mm(self) -> Estimate:
        """Bending stiffness D = E t³ / 12 (1 − ν²), ν = .5: better known than its parts."""
        value = self.E_mpa * self.wall_mm**3 / 9
        return Estimate.of(value, value * _stiffness_sigma(self.covariance))

    def material(self, material: Material) -> Material:
        """The material with these values, their σ and their correlations."""
        sigma = self.sigma
        related = self.covariance / np.outer(sigma, sigma)
        return replace(
            material,
            E_mpa=self.E_mpa,
            wall_mm=self.wall_mm,
            F0_n=self.F0_n,
            # The middle of the wall lies as much farther in as half the wall is thicker.
            radius_mm=material.radius_mm - (self.wall_mm - material.wall_mm) / 2,
            E_sigma_mpa=self.E_mpa * float(sigma[0]),
            wall_sigma_mm=self.wall_mm * float(sigma[1]),
            F0_sigma_n=self.F0_n * float(sigma[2]),
            E_wall_correlation=float(related[0, 1]),
            E_F0_correlation=float(related[0, 2]),
            F0_wall_correlation=float(related[1, 2]),
        )


def liner_values(
    grid: Grid,
    material: Material,
    reference: Points | None,
    levels: Sequence[RampLevel],
    common_sigma_kpa: float,
    rig: Rig | None = None,
) -> LinerValues:
    """The liner's own values.

    Args:
        grid: targets of the object model, on a cylinder.
        material: what is known before the ramp; E within some 20 %, thickness within 5 %.
        reference: targets of the open liner; None for the object model's.
        levels: of the ramp, in any order.
        common_sigma_kpa: σ of the pressure difference that all levels share, the gauge's.
        rig: whose views saw the points; None if targets that one view alone sees are of no use.

    Raises:
        AnalysisError: the inputs make no wall, the ramp does not buckle it, too few levels can be used, or
            points and equilibrium contradict each other.
    """
    if material.F0_n == 0:
        raise AnalysisError("the pretension of the liner is given as 0", "give F0_n, with its σ")
    if not levels:
        raise AnalysisError("the ramp has no levels", "measure its fields, and give both vacuums")
    mounting = Mounting.of(grid, material, reference, rig)
    unused, fallen_mm = _unused(mounting, grid, levels)
    used = _used(unused, levels)
    chosen = [levels[index] for index in used]
    ramp = _ramp(mounting, grid, material, chosen, common_sigma_kpa)
    buckled = _BUCKLED * material.radius_mm
    fit = fit_ramp(ramp, [fallen_mm[index] * (fallen_mm[index] > buckled) for index in used])
    misfit, covariance = float(fit.misfit.mean()), fit.covariance[:TUBE_VALUES, :TUBE_VALUES].copy()
    covariance += np.diag(np.square(list(LAW_SIGMA.values())))
    _check(misfit, covariance, len(used))
    young, thickness, pretension = np.exp(fit.values[:TUBE_VALUES])
    return LinerValues(
        E_mpa=float(material.E_mpa * young),
        wall_mm=float(material.wall_mm * thickness),
        F0_n=float(material.F0_n * pretension),
        covariance=covariance,
        own=fit.own[:TUBE_VALUES, :TUBE_VALUES],
        used=tuple(used),
        difference_kpa=Estimate(fit.values[TUBE_VALUES:], np.sqrt(np.diagonal(fit.covariance)[TUBE_VALUES:])),
        misfit=misfit,
        unused=unused,
    )


def used_levels(
    grid: Grid, material: Material, reference: Points | None, levels: Sequence[RampLevel]
) -> list[int]:
    """Indices of the levels that `liner_values` fits, by rising pressure difference.

    Raises:
        AnalysisError: as `liner_values`, where it does not need the fit.
    """
    return _used(_unused(Mounting.of(grid, material, reference), grid, levels)[0], levels)


def _used(unused: Sequence[str], levels: Sequence[RampLevel]) -> list[int]:
    among = (index for index, reason in enumerate(unused) if not reason)
    return sorted(among, key=lambda index: levels[index].difference.kpa)


def _unused(mounting: Mounting, grid: Grid, levels: Sequence[RampLevel]) -> tuple[tuple[str, ...], Array]:
    """Level by level why it is not fitted (empty where it is), and how far its wall has come in, mm.

    Raises:
        AnalysisError: the ramp does not tell the liner's values.
    """
    radius_mm = mounting.half.tube.radius_mm
    heights = row_heights(mounting, grid, levels).value
    least_mm = np.nan_to_num(heights, nan=np.inf).min(axis=1)
    fallen_mm = np.nan_to_num(_open_heights(levels, heights) - heights, nan=-np.inf).max(axis=1)
    touching = least_mm < _TOUCHING * radius_mm
    buckled = ~touching & (fallen_mm > _BUCKLED * radius_mm)
    kpa = np.array([level.difference.kpa for level in levels])
    buckles_kpa = kpa[buckled].min(initial=np.inf)
    is_open = (np.abs(fallen_mm) < _OPEN * radius_mm) & (kpa > _PART * buckles_kpa) & (kpa < buckles_kpa)
    if not (buckled | touching).any():
        raise AnalysisError(
            f"the ramp does not buckle the liner: up to {kpa.max(initial=0.0):.3g} kPa its wall comes in by "
            f"{fallen_mm.max(initial=0.0):.2g} mm",
            "let the pressure difference rise until opposite walls touch",
        )
    if buckled.sum() < LEAST_LEVELS:
        raise AnalysisError(
            f"only {buckled.sum()} of {len(levels)} levels lie between buckling and touch, "
            f"{LEAST_LEVELS} are needed",
            "let the pressure difference rise more slowly, or in smaller steps",
        )
    chosen = {*_spread(fallen_mm, buckled, _MOST_BUCKLED), *_spread(kpa, is_open, _MOST_OPEN)}
    reasons = np.select(
        [touching, np.isin(np.arange(len(levels)), list(chosen)), buckled],
        ["opposite walls touch", "", "others nearby are enough"],
        "not buckled enough to tell",
    )
    return tuple(map(str, reasons)), fallen_mm


def _open_heights(levels: Sequence[RampLevel], heights: Array) -> Array:
    """(R,) heights in the level with the least pressure difference."""
    least = int(np.argmin([abs(level.difference.kpa) for level in levels]))
    return heights[least]


def _spread(values: Array, among: Mask, most: int) -> list[int]:
    """Indices of at most `most`, evenly spread by value."""
    index = np.flatnonzero(among)
    if len(index) <= most:
        return [int(one) for one in index]
    wanted = np.linspace(values[index].min(), values[index].max(), most)
    return [int(index[np.abs(values[index] - one).argmin()]) for one in wanted]


def _ramp(
    mounting: Mounting,
    grid: Grid,
    material: Material,
    levels: Sequence[RampLevel],
    common_sigma_kpa: float,
) -> Ramp:
    kpa = np.array([level.difference.kpa for level in levels])
    own = np.array([max(level.difference.sigma_kpa, _LEAST_SIGMA_KPA) for level in levels])
    covariance = np.zeros((TUBE_VALUES + len(kpa),) * 2)
    covariance[:TUBE_VALUES, :TUBE_VALUES] = TubePrior.of(material).covariance
    covariance[TUBE_VALUES:, TUBE_VALUES:] = np.diag(own**2) + common_sigma_kpa**2
    sights = [mounting.sights(level.points, grid, shared=False) for level in levels]
    return Ramp(
        EmptyWall(mounting.half, mounting.targets),
        sights,
        np.concatenate([np.zeros(TUBE_VALUES), kpa]),
        covariance,
        own**2,
        mounting.shared_mm2,
        _model_mm2(mounting),
    )


def _model_mm2(mounting: Mounting) -> Array:
    """(3 T, 3 T) covariance of the model's own error, alike in all levels."""
    s_mm, x_mm, _ = mounting.targets
    near = np.exp(
        -0.5 * ((s_mm[:, np.newaxis] - s_mm) / _MODEL_ROUND_MM) ** 2
        - 0.5 * ((x_mm[:, np.newaxis] - x_mm) / _MODEL_ALONG_MM) ** 2
    )
    return np.asarray(np.kron(_MODEL_MM**2 * near, np.eye(3)), np.float64)


def _stiffness_sigma(covariance: Array) -> float:
    powers = np.array([1.0, 3.0, 0.0])
    return float(np.sqrt(powers @ covariance @ powers))


def _check(misfit: float, covariance: Array, levels: int) -> None:
    if misfit > MISFIT_ALARM:
        raise AnalysisError(
            f"points and the empty wall's equilibrium contradict each other (misfit {misfit:.1f} over "
            f"{levels} levels, usual about 1)",
            "check that the liner is empty and flattens towards the cameras, its ends, and the vacuum",
        )
    sigma = _stiffness_sigma(covariance)
    if sigma > _SIGMA_STIFFNESS:
        raise AnalysisError(
            f"the ramp gives the wall's stiffness E t³ to {sigma:.0%} only",
            "measure the pressure difference to .3 kPa, and take more levels between buckling and touch",
        )


_Found = tuple[tuple[Estimate, float], ...]
"""Estimates, each with the part of its σ that other ramps share."""
_BY_RAMP = "found as the values of an empty wall in equilibrium, from a ramp of the pressure difference"

COLLAPSE: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "touch_kpa",
            "touch point pressure difference (TPPD)",
            "kPa",
            "Pressure difference at which opposite walls of the empty liner just touch.",
            "ISO 3918; from the distance of the walls over the pressure difference, drawn on to the touch",
        ),
        Quantity(
            "buckling_kpa",
            "critical collapsing pressure difference (CCPD)",
            "kPa",
            "Pressure difference at which the empty liner buckles: where the line of the open wall meets the "
            "steepest fall of the buckling one.",
            "critical collapsing pressure difference as in milking research",
        ),
    )
}
VALUES: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "stiffness_n_mm",
            "bending stiffness of the liner",
            "N mm",
            "E t³ / 12 (1 − ν²) of the mounted liner's wall: better known than its parts.",
            _BY_RAMP,
        ),
        Quantity("E_mpa", "Young's modulus of the liner", "MPa", "Modulus of the mounted liner.", _BY_RAMP),
        Quantity(
            "wall_mm", "thickness of the liner", "mm", "Thickness of the mounted liner's wall.", _BY_RAMP
        ),
        Quantity("F0_n", "pretension of the liner", "N", "Force along the mounted liner.", _BY_RAMP),
    )
}


def ramp_quantities(
    values: LinerValues | None, collapse: Collapse | None, reasons: tuple[str, str]
) -> tuple[Finding, ...]:
    """Quantities of a ramp; the reasons are why there are no values, and no collapse."""
    return (
        *_findings(COLLAPSE.values(), _of_collapse(collapse) if collapse else (), reasons[1]),
        *_findings(VALUES.values(), _of_values(values) if values else (), reasons[0]),
    )


def _of_collapse(found: Collapse) -> _Found:
    return (found.touch_kpa, found.touch_common_kpa), (found.buckling_kpa, found.buckling_common_kpa)


def _of_values(values: LinerValues) -> _Found:
    parts = np.array([values.E_mpa, values.wall_mm, values.F0_n])
    estimates = (values.stiffness_n_mm, *map(Estimate, parts, parts * values.sigma))
    relative = np.roll(values.common_sigma, 1)
    return tuple((one, float(one.value * shared)) for one, shared in zip(estimates, relative, strict=True))


def _findings(quantities: Iterable[Quantity], found: _Found, reason: str) -> tuple[Finding, ...]:
    if not found:
        return tuple(Finding.missing(quantity, reason) for quantity in quantities)
    return tuple(Finding.of(quantity, *one) for quantity, one in zip(quantities, found, strict=True))
