"""Residuals of an adjustment: blunders, an error common to all image points, normality, and pattern.

Blunders are found by Pope's test, one image point at a time. Means over many fields are known to some
thousandths of a pixel, while mirrors are uneven by some hundredths: weighted by their own σ alone, the points
that scatter least would decide everything, and all others would look like blunders (docs/decisions).
Residuals of neighbouring targets agree if the model is wrong there; noise does not make them do so.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import chdtrc, stdtrit

from grabberd.core.arrays import Array, Mask
from grabberd.core.calibration.adjustment.adjustment import Adjustment, AdjustmentSettings, adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.errors import MeasurementError

_MEDIAN = 0.6745
"""Median size of a normal error, in units of σ."""
_MASKED = 1.25
"""Factor on the critical value for residuals judged by the σ0 of their median, which hidden blunders
exceed."""
_ALPHA = 0.01
"""Probability of finding a blunder among image points that have none."""
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
    *,
    most_share: float = MOST_SHARE,
) -> tuple[Adjustment, tuple[Blunder, ...]]:
    """Adjust and leave out the image point with the greatest τ, repeatedly until none is too great.

    Many blunders mask one another, since all enlarge σ0; so a residual is also tested, less strictly, against
    the σ0 given by the median of all residuals. A target of unknown position left with too few views loses
    its other image points, too.

    Args:
        network: Image points; a blunder is left out with both coordinates.
        unknowns: Parameters to estimate.
        most_share: Greatest share of image points that may be left out.

    Raises:
        MeasurementError: More than that share would have to be left out; or as `adjust`.
    """
    most = most_share * len(network)
    blunders: list[Blunder] = []
    strict = AdjustmentSettings()
    for current in (replace(strict, settled=max(strict.settled, _SETTLED)), strict):
        while True:
            adjusted = adjust(network, unknowns, current)
            blunder, kept = _worst(adjusted)
            network = network.starting_from(adjusted.views)
            if blunder is None:
                break
            blunders.append(blunder)
            if len(blunders) > most:
                raise _too_many(network, blunders, most)
            network = _determined(network.select(kept))
    return adjusted, tuple(blunders)


def _worst(adjusted: Adjustment) -> tuple[Blunder | None, Mask]:
    network = adjusted.network
    kept = np.ones(len(network), np.bool_)
    # A certificate better than stated makes σ0 small: good image points would look like blunders.
    size = np.abs(adjusted.standardised) * min(1.0, adjusted.sigma0 / max(adjusted.sigma0_images, _EXACT))
    worst = np.nan_to_num(size).max(axis=1)
    # One at a time: a blunder raises the residuals of good points around it.
    index = int(worst.argmax())
    critical = critical_tau(2 * len(network), adjusted.freedom, _ALPHA) if adjusted.freedom > 1 else np.inf
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


_ENOUGH = 1e-3
_MOST_STEPS = 40
_ROUGHLY_PX = 0.1
"""Start value: with weights that differ by a factor of a hundred, convergence from afar is poor."""
_CLEAR = 3.0
"""Standard deviations of σ0² by which it is clearly above 1, and not by chance."""
_NEAR = 4.0
"""Multiple of the points' own σ up to which the common error may be there by chance."""
_NEGLIGIBLE = 0.05
"""Share of the points' own σ below which the common error counts as zero."""


def with_unmodelled(network: Network, unknowns: Unknowns) -> tuple[Network, float]:
    """Enlarge the σ of a network in quadrature so that σ0 becomes 1.

    Where image points then still contradict each other by more than their own σ, it is that of the image
    points alone: a certificate that is better than it states would hide what is unmodelled. A σ0 that is
    above 1 by chance enlarges nothing: at 1 bit it would stand for mirrors uneven by .01 to .03 px.

    Returns:
        The network, and the σ added in px: 0 if the points' own σ explain their residuals.

    Raises:
        MeasurementError: As `adjust`.
    """
    network, added, adjusted = _balanced(network, unknowns, lambda one: one.sigma0, _ROUGHLY_PX)
    if 0.0 < added < _NEAR * np.sqrt(np.mean(network.sigma_px**2)):
        own = adjust(network, unknowns)
        if own.sigma0 < _clear(own.freedom):
            added, adjusted = 0.0, own
    if adjusted.sigma0_images > _clear(adjusted.redundancy.sum()):
        start = max(added, float(np.sqrt(np.mean(network.sigma_px**2))))
        network, added, _ = _balanced(network, unknowns, lambda one: one.sigma0_images, start)
    return enlarged(network, added), added


def _clear(freedom: float) -> float:
    """σ0 beyond which it is not by chance above 1."""
    return float(np.sqrt(1.0 + _CLEAR * np.sqrt(2.0 / max(freedom, 1.0))))


def _balanced(
    network: Network,
    unknowns: Unknowns,
    measure: Callable[[Adjustment], float],
    added: float,
) -> tuple[Network, float, Adjustment]:
    """The network from a better start, what makes a measure of its adjustment 1, and the last adjustment."""
    low, high = 0.0, np.inf
    negligible = _NEGLIGIBLE * float(np.sqrt(np.mean(network.sigma_px**2)))
    for _ in range(_MOST_STEPS):
        adjusted = adjust(enlarged(network, added), unknowns)
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


_FEWEST = 8


@dataclass(frozen=True, slots=True)
class Normality:
    """Shape of the distribution of standardised residuals.

    Attributes:
        of: Name of the view, or "all".
        count: Number of residuals, without uncontrolled ones.
        skewness: 0 for a normal distribution.
        kurtosis: Excess kurtosis, 0 for a normal distribution.
        statistic: Jarque–Bera statistic with finite-sample variances of the moments (Urzúa 1996).
        p: Probability of a statistic at least so large under normality; NaN for fewer than eight residuals.
    """

    of: str
    count: int
    skewness: float
    kurtosis: float
    statistic: float
    p: float


def normality(adjusted: Adjustment) -> tuple[Normality, ...]:
    """Test every view's residuals, x and y together, then all of them."""
    standardised, view = adjusted.standardised, adjusted.network.view
    views = [
        normality_of(standardised[view == index].ravel(), one.name)
        for index, one in enumerate(adjusted.network.views)
    ]
    return *views, normality_of(standardised.ravel(), "all")


def normality_of(values: Array, of: str) -> Normality:
    """Test any values (N,), ignoring NaN."""
    values = values[np.isfinite(values)]
    n = len(values)
    if n < _FEWEST or not np.ptp(values):
        return Normality(of, n, np.nan, np.nan, np.nan, np.nan)
    away = values - values.mean()
    spread = np.mean(away**2)
    skewness = float(np.mean(away**3) / spread**1.5)
    kurtosis = float(np.mean(away**4) / spread**2)
    expected = 3 * (n - 1) / (n + 1)
    variance = 24 * n * (n - 2) * (n - 3) / ((n + 1) ** 2 * (n + 3) * (n + 5))
    statistic = skewness**2 * (n + 1) * (n + 3) / (6 * (n - 2)) + (kurtosis - expected) ** 2 / variance
    return Normality(of, n, skewness, kurtosis - 3, statistic, float(chdtrc(2, statistic)))


_NEIGHBOURS = 4
_LEAST_IMAGES = 16


@dataclass(frozen=True, slots=True)
class Pattern:
    """Agreement of one view's neighbouring residuals.

    Attributes:
        view: Name of the view.
        correlation: Correlation of a residual with the mean of its neighbours' (Moran's I); 0 for noise.
        statistic: Its deviation from that of noise, in its own σ.
        rms_px: Root mean square of the residuals.
    """

    view: str
    correlation: float
    statistic: float
    rms_px: float


def residual_patterns(adjustment: Adjustment) -> tuple[Pattern, ...]:
    """Measure the agreement in each view that shows enough targets, x and y together."""
    views = enumerate(adjustment.views)
    return tuple(
        _pattern(view.name, adjustment, own)
        for index, view in views
        if (own := adjustment.network.view == index).sum() >= _LEAST_IMAGES
    )


def _pattern(name: str, adjustment: Adjustment, own: Mask) -> Pattern:
    xy, residual = adjustment.network.xy_px[own], adjustment.residual_px[own]
    near = np.asarray(cKDTree(xy).query(xy, k=_NEIGHBOURS + 1)[1])[:, 1:]
    centred = residual - residual.mean(axis=0)
    lag = centred[near].mean(axis=1)
    square = float((centred**2).sum())
    correlation = float((centred * lag).sum()) / square if square else 0.0
    # Under noise the mean of k neighbours has the variance 1/k, x and y are two samples.
    sigma = 1.0 / np.sqrt(_NEIGHBOURS * centred.size / 2)
    return Pattern(name, correlation, correlation / float(sigma), float(np.sqrt((residual**2).mean())))
