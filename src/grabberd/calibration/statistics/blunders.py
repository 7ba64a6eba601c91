"""Image points that contradict all others: Pope's test of the standardised residuals, one at a time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from grabberd.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.calibration.adjustment.network import Network
from grabberd.calibration.adjustment.unknowns import Unknowns
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]

_MEDIAN = 0.6745
"""Median of a normal error's size, in units of its σ."""
_MASKED = 1.25
"""A residual that many times too great for a σ0 from the median is a blunder hidden by others."""
_EXACT = 1e-3
_SETTLED = 1e-4
"""Blunders show long before an adjustment has converged, which is slow with many of them."""

MOST_SHARE = 0.1
"""Of the image points may be blunders; where more are, something else is wrong."""


@dataclass(frozen=True, slots=True)
class Blunder:
    """An image point that was left out.

    Attributes:
        view: name of its view; `target`: index of its target.
        xy_px: where it is, frame pixels; `residual_px`: observed minus computed, with it in the adjustment.
        redundancy: of its two coordinates.
        tau: the greater of its standardised residuals; `critical`: what it may be at most, unless blunders
            hide one another.
    """

    view: str
    target: int
    xy_px: tuple[float, float]
    residual_px: tuple[float, float]
    redundancy: tuple[float, float]
    tau: float
    critical: float


def critical_tau(count: int, freedom: int, alpha: float) -> float:
    """What the greatest of `count` standardised residuals exceeds with the probability `alpha` (Pope's τ).

    σ0 is estimated from the same residuals, so none can exceed √freedom.
    """
    single = -np.expm1(np.log1p(-alpha) / count)
    student = -float(stdtrit(freedom - 1, single / 2))
    return student * float(np.sqrt(freedom / (freedom - 1 + student**2)))


def without_blunders(
    network: Network,
    unknowns: Unknowns,
    settings: AdjustmentSettings | None = None,
    *,
    alpha: float = 0.01,
    most_share: float = MOST_SHARE,
) -> tuple[Adjustment, tuple[Blunder, ...]]:
    """Adjusts, leaves the image point with the greatest τ out, and so on until none is too great.

    Many blunders hide one another, as all of them make σ0 greater; so a residual is tested against the σ0
    that the median of all residuals gives too, less strictly. A target of unknown place that too few views
    are left of goes with its other image points.

    Args:
        network: image points; a blunder is left out with both its coordinates.
        unknowns: which parameters are sought.
        settings: of the adjustments.
        alpha: of finding a blunder anywhere among image points that have none.
        most_share: of the image points that may be left out.

    Raises:
        MeasurementError: more than that share would have to be; or as `adjust`.
    """
    most = most_share * len(network)
    found: list[Blunder] = []
    strict = settings or AdjustmentSettings()
    for current in (replace(strict, settled=max(strict.settled, _SETTLED)), strict):
        while True:
            adjusted = adjust(network, unknowns, current)
            blunder, kept = _worst(adjusted, alpha)
            network = network.starting_from(adjusted.views)
            if blunder is None:
                break
            found.append(blunder)
            if len(found) > most:
                raise _too_many(found, most)
            network = _determined(network.select(kept))
    return adjusted, tuple(found)


def _worst(adjusted: Adjustment, alpha: float) -> tuple[Blunder | None, NDArray[np.bool_]]:
    network = adjusted.network
    kept = np.ones(len(network), np.bool_)
    size = np.abs(adjusted.standardised)
    worst = np.nan_to_num(size).max(axis=1)
    index = int(worst.argmax())
    critical = critical_tau(2 * len(network), adjusted.freedom, alpha) if adjusted.freedom > 1 else np.inf
    if max(worst[index], worst[index] / (_MASKED * _inflation(adjusted, size))) <= critical:
        return None, kept
    kept[index] = False
    blunder = Blunder(
        view=network.views[network.view[index]].name,
        target=int(network.target[index]),
        xy_px=_pair(network.xy_px[index]),
        residual_px=_pair(adjusted.residual_px[index]),
        redundancy=_pair(adjusted.redundancy[index]),
        tau=float(worst[index]),
        critical=critical,
    )
    return blunder, kept


def _inflation(adjusted: Adjustment, size: Array) -> float:
    """σ0 from the median of the residuals over σ0 as estimated; 1 for pictures without any error."""
    if adjusted.sigma0 < _EXACT:
        return 1.0
    return max(float(np.nanmedian(size)) / _MEDIAN, _EXACT)


def _determined(network: Network) -> Network:
    lost = network.undetermined
    return network.select(~lost[network.target]) if lost.any() else network


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _too_many(found: list[Blunder], most: float) -> MeasurementError:
    some = ", ".join(f"target {one.target} in view {one.view}" for one in found[:5])
    return MeasurementError(
        f"more than {most:.0f} image points contradict the others, to begin with {some}",
        "so many are no blunders: check the calibration frame's file, which target is which, and the views",
    )
