"""Blunder detection: Pope's test of the standardised residuals, one image point at a time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.adjustment.unknowns import Unknowns
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]

_MEDIAN = 0.6745
"""Median size of a normal error, in units of σ."""
_MASKED = 1.25
"""Factor on the critical value for residuals judged by the σ0 of their median, which hidden blunders
exceed."""
_EXACT = 1e-3
_SETTLED = 1e-4
"""Coarse convergence while blunders remain: they show early, and slow convergence down."""

MOST_SHARE = 0.1
"""Greatest share of image points that may be blunders; if there are more, something else is wrong."""


@dataclass(frozen=True, slots=True)
class Blunder:
    """Image point that was left out.

    Attributes:
        view: Name of its view.
        target: Index of its target.
        xy_px: Its position, frame pixels.
        residual_px: Observed minus computed, with it in the adjustment.
        redundancy: Redundancy of its two coordinates.
        tau: The greater of its standardised residuals.
        critical: The greatest value allowed, unless blunders mask one another.
    """

    view: str
    target: int
    xy_px: tuple[float, float]
    residual_px: tuple[float, float]
    redundancy: tuple[float, float]
    tau: float
    critical: float


def critical_tau(count: int, freedom: int, alpha: float) -> float:
    """Critical value of the greatest of `count` standardised residuals at significance `alpha` (Pope's τ).

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
    """Adjust and leave out the image point with the greatest τ, repeatedly until none is too great.

    Many blunders mask one another, since all enlarge σ0; so a residual is also tested, less strictly, against
    the σ0 given by the median of all residuals. A target of unknown position left with too few views loses
    its other image points, too.

    Args:
        network: Image points; a blunder is left out with both coordinates.
        unknowns: Parameters to estimate.
        settings: Settings of the adjustments.
        alpha: Probability of finding a blunder among image points that have none.
        most_share: Greatest share of image points that may be left out.

    Raises:
        MeasurementError: More than that share would have to be left out; or as `adjust`.
    """
    most = most_share * len(network)
    blunders: list[Blunder] = []
    strict = settings or AdjustmentSettings()
    for current in (replace(strict, settled=max(strict.settled, _SETTLED)), strict):
        while True:
            adjusted = adjust(network, unknowns, current)
            blunder, kept = _worst(adjusted, alpha)
            network = network.starting_from(adjusted.views)
            if blunder is None:
                break
            blunders.append(blunder)
            if len(blunders) > most:
                raise _too_many(network, blunders, most)
            network = _determined(network.select(kept))
    return adjusted, tuple(blunders)


def _worst(adjusted: Adjustment, alpha: float) -> tuple[Blunder | None, NDArray[np.bool_]]:
    network = adjusted.network
    kept = np.ones(len(network), np.bool_)
    # A certificate better than stated makes σ0 small: good image points would look like blunders.
    size = np.abs(adjusted.standardised) * min(1.0, adjusted.sigma0 / max(adjusted.sigma0_images, _EXACT))
    worst = np.nan_to_num(size).max(axis=1)
    # One at a time: a blunder raises the residuals of good points around it.
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
    """Ratio of the σ0 from the median of the residuals to the estimated σ0; 1 for error-free pictures."""
    if adjusted.sigma0 < _EXACT:
        return 1.0
    return max(float(np.nanmedian(size)) / _MEDIAN, _EXACT)


def _determined(network: Network) -> Network:
    lost = network.undetermined
    return network.select(~lost[network.target]) if lost.any() else network


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _too_many(network: Network, blunders: list[Blunder], most: float) -> MeasurementError:
    some = ", ".join(f"target {network.id_of(one.target)} in view {one.view}" for one in blunders[:5])
    return MeasurementError(
        f"more than {most:.0f} image points contradict the others, starting with {some}",
        "this many cannot be blunders: check the calibration frame's file, which target is which, and the "
        "views",
    )
