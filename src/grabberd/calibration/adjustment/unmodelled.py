"""What image points show beyond their own σ: a standard deviation that all of them have in common.

Means over many fields are known to some thousandths of a pixel, mirrors are uneven by some hundredths.
Weighted by their own σ alone, the points that scatter least would decide everything, and all would look like
blunders.
"""

from dataclasses import replace

import numpy as np

from grabberd.calibration.adjustment.adjustment import adjust
from grabberd.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.calibration.adjustment.network import Network
from grabberd.calibration.adjustment.unknowns import Unknowns

_ENOUGH = 1e-3
_MOST_STEPS = 40
_ROUGHLY_PX = 0.1
"""To begin with: weights that differ by a factor of a hundred are hard to converge with from afar."""
_NEGLIGIBLE = 0.05
"""Of the points' own σ."""


def with_unmodelled(
    network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None = None
) -> tuple[Network, float]:
    """The network with its σ enlarged in quadrature so that σ0 becomes 1.

    Args:
        network: image points with their own σ.
        unknowns: which parameters are sought.
        settings: of the adjustments.

    Returns:
        The network, and what was added in px: 0 where the points' own σ explain their residuals.

    Raises:
        MeasurementError: as `adjust`.
    """
    low, high, added = 0.0, np.inf, _ROUGHLY_PX
    negligible = _NEGLIGIBLE * float(np.sqrt(np.mean(network.sigma_px**2)))
    for _ in range(_MOST_STEPS):
        adjusted = adjust(enlarged(network, added), unknowns, settings)
        network = network.starting_from(adjusted.views)
        excess = adjusted.sigma0 - 1.0
        if abs(excess) < _ENOUGH or (added == 0.0 and excess < 0):
            break
        low, high = (added, high) if excess > 0 else (low, added)
        guess = _next(low, high, added, adjusted.sigma0)
        added = guess if guess > negligible else 0.0
    return enlarged(network, added), added


def enlarged(network: Network, added_px: float) -> Network:
    """The network with every image point's σ enlarged in quadrature."""
    return replace(network, sigma_px=np.hypot(network.sigma_px, added_px))


def _next(low: float, high: float, added: float, sigma0: float) -> float:
    """Nearly proportional where the common part is the larger; held inside what is known of it."""
    guess = added * sigma0
    if low < guess < high:
        return guess
    return 0.5 * (low + high) if np.isfinite(high) else 2.0 * low
