"""Trial of local fields: estimated from an adjustment's residuals, accepted only if they are there.

Collocation separates them from the trend and from errors of the calibration frame; the views are then
adjusted again to image points less the fields. They are accepted only if errors of this pattern are far more
likely than errors without any, and held-out targets are predicted better (docs/decisions/calibration.md).
"""

from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.calibration.adjustment.adjustment import Adjustment, AdjustmentSettings, adjust, divided
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.collocation import Collocation, Components, Solution, evidence_of, most_likely
from grabberd.core.geometry import LocalField, LocalFields, parameter_derivatives, project, rays

_ROUNDS = 3
"""Rounds of adjustment and collocation; the problem is nearly linear, and its curvature needs more than
one."""
_SETTLED = AdjustmentSettings(settled=1e-7)
"""Coarser convergence, since each adjustment starts close to its solution."""
_NODES_A_LENGTH = 1.6
"""Spline nodes per correlation length: enough to follow the signal to a few per cent."""
_DECIMALS = 5
_MOST = 0.99
"""Greatest correlation of the errors of both local fields."""


@dataclass(frozen=True, slots=True)
class LocalFieldSettings:
    """Criteria for accepting local fields.

    Attributes:
        evidence: Least log likelihood of a smooth signal over that of errors without any pattern. What each
            target's place in the certificate adds to its images hides a signal from the prediction of single
            targets, but not from all of them together.
    """

    evidence: float = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class LocalFieldTrial:
    """Result of trying local fields.

    Attributes:
        accepted: True if the evidence is that of the settings, and held-out targets are predicted better.
        fields: One per view; None if nothing was accepted.
        adjustment: The views that belong to the fields, adjusted to image points less the fields; its σ are
            those estimated and taken as true, so σ0 is 1, since the fields have absorbed part of the
            residuals. The given adjustment if nothing was accepted.
        components: Signal, correlation length, and multiples of the given σ.
        held_out_px: (V, 2) RMS error per coordinate in each view of predicting a target left out: without
            field, with it.
        gain: Decrease of their squares in standard errors.
        evidence: Log likelihood of the signal over that of errors without any pattern.
    """

    accepted: bool
    fields: tuple[LocalField | None, ...]
    adjustment: Adjustment
    components: Components
    held_out_px: Array
    gain: float
    evidence: float

    @property
    def both(self) -> LocalFields:
        """Those of both cameras."""
        left, right = self.fields[:2]
        return LocalFields(left, right)


@dataclass(frozen=True, slots=True, eq=False)
class AcceptedFields(LocalFieldTrial):
    """Local fields that were accepted.

    Attributes:
        correlation: Of the errors left in both fields, in x and in y, where they show the same target.
    """

    correlation: tuple[float, float]

    @property
    def both(self) -> LocalFields:
        """Those of both cameras."""
        left, right = self.fields[:2]
        return LocalFields(left, right, self.correlation)


def try_local_fields(
    adjustment: Adjustment, lines: int, settings: LocalFieldSettings | None = None, unmodelled_px: float = 0.0
) -> LocalFieldTrial:
    """Estimate local fields from an adjustment's residuals, and try them on held-out targets.

    Args:
        adjustment: Adjustment of all views, without blunders.
        lines: Height of the picture in frame lines.
        settings: Criteria of acceptance.
        unmodelled_px: Part of the image points' σ that stands for errors of the model (`with_unmodelled`),
            which are estimated here.

    Raises:
        MeasurementError: The adjustment with the fields subtracted does not converge.
    """
    located = _located(adjustment.network, unmodelled_px)
    collocation = _collocation(adjustment, located)
    components = most_likely(collocation)
    smooth = Solution(collocation, components).held_out()
    rough = Solution(collocation, components.uncorrelated).held_out()
    gain = _gain(adjustment.network, rough, smooth)
    held_out_px = _rms(adjustment.network, rough, smooth)
    evidence = evidence_of(collocation, components)
    if not (gain > 0 and evidence > (settings or LocalFieldSettings()).evidence):
        nothing = (None,) * len(adjustment.views)
        return LocalFieldTrial(False, nothing, adjustment, components, held_out_px, gain, evidence)
    refined, solution = _refined(adjustment, located, components)
    fields = tuple(_field(solution, refined, view, lines) for view in range(len(refined.views)))
    correlation = _correlation(solution, refined)
    return AcceptedFields(True, fields, refined, components, held_out_px, gain, evidence, correlation)


def _located(network: Network, unmodelled_px: float) -> Network:
    """Network with the σ of location alone."""
    return replace(network, sigma_px=np.sqrt(network.sigma_px**2 - unmodelled_px**2))


def _collocation(adjustment: Adjustment, network: Network) -> Collocation:
    return Collocation(network, adjustment.unknowns, adjustment.views, adjustment.xyz_mm)


def _gain(network: Network, rough: Array, smooth: Array) -> float:
    """Mean decrease of a target's squared errors, in units of its standard error."""
    less = np.bincount(network.target, ((rough**2) - (smooth**2)).sum(axis=1))[np.unique(network.target)]
    deviation = float(less.std(ddof=1))
    return float(less.mean()) * len(less) ** 0.5 / deviation if deviation > 0 else 0.0


def _rms(network: Network, *errors: Array) -> Array:
    views = range(len(network.views))
    return np.array([[np.sqrt((one[network.view == view] ** 2).mean()) for one in errors] for view in views])


def _refined(adjustment: Adjustment, network: Network, components: Components) -> tuple[Adjustment, Solution]:
    """Alternate adjustment and signal; the last solution belongs to the last adjustment."""
    weighted = replace(
        network,
        sigma_px=network.sigma_px * components.noise,
        target_sigma_mm=network.target_sigma_mm * components.place,
    )
    solution = Solution(_collocation(adjustment, network), components)
    for _ in range(_ROUNDS):
        # Adjusted to what is left of the image points, the views no longer bend to follow the signal.
        signal = solution.signal(network.view, network.xy_px)
        corrected = replace(weighted, xy_px=network.xy_px - signal, views=adjustment.views)
        adjustment = adjust(corrected, adjustment.unknowns, _SETTLED)
        solution = Solution(_collocation(adjustment, network), components)
    return replace(divided(adjustment, adjustment.sigma0**2), sigma0=1.0), solution


def _field(solution: Solution, adjustment: Adjustment, view: int, lines: int) -> LocalField:
    """Local field from the solution's signal at nodes over the view's half, with σ of trend and signal
    there.
    """
    own = adjustment.views[view]
    step = float(np.round(solution.components.length_px / _NODES_A_LENGTH, 1))
    columns, rows = (int(np.ceil(size / step)) + 1 for size in (own.end_column - own.first_column, lines))
    origin = (own.first_column - 0.5, -0.5)
    x, y = np.meshgrid(origin[0] + step * np.arange(columns), origin[1] + step * np.arange(rows))
    nodes = np.column_stack([x.ravel(), y.ravel()])
    shift = solution.signal(view, nodes).round(_DECIMALS)
    sigma = _sigma(solution, adjustment, view, nodes).round(_DECIMALS)
    grid = (rows, columns, 2)
    return LocalField.through(origin, step, shift.reshape(grid), sigma.reshape(grid))


def _sigma(solution: Solution, adjustment: Adjustment, view: int, xy_px: Array) -> Array:
    """(N, 2) σ not included in the adjustment's own covariance, at the targets' mean distance."""
    trend = _trend(adjustment, view, xy_px)
    own = ((trend @ adjustment.covariance) * trend).sum(axis=2)
    both = solution.covariance([view], xy_px[np.newaxis], trend[np.newaxis])[:, :, 0, 0]
    left = np.maximum(both - own, 0.0)
    seen = np.isfinite(left)  # beyond the fold of the distortion no target can be
    return np.sqrt(np.where(seen, left, solution.components.signal_px**2)).T


def _correlation(solution: Solution, adjustment: Adjustment) -> tuple[float, float]:
    """Correlation of what `_sigma` states, in x and in y, between both cameras' images of one target.

    Errors of the certificate move both images of a target alike. Taken for independent, they would make Z
    less certain than it is, and X and Y more.
    """
    seen = np.unique(adjustment.network.target)
    xyz_mm = adjustment.xyz_mm[seen]
    pair = list(enumerate(adjustment.views[:2]))
    trend = np.array([_slopes(adjustment, view, xyz_mm) for view, _ in pair])
    xy_px = np.array([project(one, xyz_mm) for _, one in pair])
    total = solution.covariance([view for view, _ in pair], xy_px, trend)
    own = np.einsum("kcnu,lcnu->cnkl", trend @ adjustment.covariance, trend)
    left = np.nansum(total - own, axis=1)
    if len(pair) < 2 or not (left[:, [0, 1], [0, 1]] > 0).all():
        return 0.0, 0.0
    x, y = (left[:, 0, 1] / np.sqrt(left[:, 0, 0] * left[:, 1, 1])).clip(-_MOST, _MOST).round(_DECIMALS)
    return float(x), float(y)


def _trend(adjustment: Adjustment, view: int, xy_px: Array) -> Array:
    """(2, N, U) slopes by the unknowns at positions (N, 2) of a view."""
    own = adjustment.views[view]
    away_mm = np.linalg.norm(adjustment.xyz_mm - own.center_mm, axis=1).mean()
    center, directions = rays(own, xy_px)
    return _slopes(adjustment, view, center + away_mm * directions)


def _slopes(adjustment: Adjustment, view: int, xyz_mm: Array) -> Array:
    """(2, N, U) slopes of the images of N points in a view by the unknowns."""
    slopes = parameter_derivatives(adjustment.views[view], xyz_mm).swapaxes(0, 1)
    chosen = adjustment.unknowns.derivatives(adjustment.views)
    chosen = chosen.reshape(len(adjustment.views), -1, len(adjustment.unknowns))
    return slopes @ chosen[view]
