"""Unmodelled error: a standard deviation common to all image points, beyond their own σ.

Means over many fields are known to some thousandths of a pixel, while mirrors are uneven by some hundredths.
Weighted by their own σ alone, the points that scatter least would decide everything, and all others would
look like blunders (docs/decisions/0005).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.adjustment.unknowns import Unknowns

_ENOUGH = 1e-3
_MOST_STEPS = 40
_ROUGHLY_PX = 0.1
"""Start value: with weights that differ by a factor of a hundred, convergence from afar is poor."""
_CLEAR = 3.0
"""Standard deviations of σ0² by which that of the image points alone is clearly above 1."""
_NEGLIGIBLE = 0.05
"""Share of the points' own σ below which the common error counts as zero."""


def with_unmodelled(
    network: Network, unknowns: Unknowns, settings: AdjustmentSettings | None = None
) -> tuple[Network, float]:
    """Enlarge the σ of a network in quadrature so that σ0 becomes 1.

    Where image points then still contradict each other by more than their own σ, it is that of the image
    points alone: a certificate that is better than it states would hide what is unmodelled.

    Returns:
        The network, and the σ added in px: 0 if the points' own σ explain their residuals.

    Raises:
        MeasurementError: As `adjust`.
    """
    network, added, adjusted = _balanced(network, unknowns, settings, lambda one: one.sigma0, _ROUGHLY_PX)
    if adjusted.sigma0_images > _clear(adjusted):
        start = max(added, float(np.sqrt(np.mean(network.sigma_px**2))))
        network, added, _ = _balanced(network, unknowns, settings, lambda one: one.sigma0_images, start)
    return enlarged(network, added), added


def _clear(adjusted: Adjustment) -> float:
    """σ0 of the image points alone beyond which it is not by chance above 1."""
    return float(np.sqrt(1.0 + _CLEAR * np.sqrt(2.0 / max(adjusted.redundancy.sum(), 1.0))))


def _balanced(
    network: Network,
    unknowns: Unknowns,
    settings: AdjustmentSettings | None,
    measure: Callable[[Adjustment], float],
    added: float,
) -> tuple[Network, float, Adjustment]:
    """The network from a better start, what makes a measure of its adjustment 1, and the last adjustment."""
    low, high = 0.0, np.inf
    negligible = _NEGLIGIBLE * float(np.sqrt(np.mean(network.sigma_px**2)))
    for _ in range(_MOST_STEPS):
        adjusted = adjust(enlarged(network, added), unknowns, settings)
        network = network.starting_from(adjusted.views)
        sigma0 = measure(adjusted)
        if abs(sigma0 - 1.0) < _ENOUGH or (added == 0.0 and sigma0 < 1.0):
            break
        low, high = (added, high) if sigma0 > 1.0 else (low, added)
        guess = _next(low, high, added, sigma0)
        added = guess if guess > negligible else 0.0
    return network, added, adjusted


def enlarged(network: Network, added_px: float) -> Network:
    """Enlarge every image point's σ in quadrature."""
    return replace(network, sigma_px=np.hypot(network.sigma_px, added_px))


def _next(low: float, high: float, added: float, sigma0: float) -> float:
    """Next guess: proportional to σ0, which suits a dominant common part, kept inside the known bracket."""
    guess = added * sigma0
    if low < guess < high:
        return guess
    return 0.5 * (low + high) if np.isfinite(high) else 2.0 * low
