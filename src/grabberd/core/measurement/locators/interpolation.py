"""Interpolation locators (paper 3.5): Vernier, and Tian and Huhns; for any number of bits.

Both use the grey values of the delivered lines. Neither has a model of the target, so neither is as accurate
as a centroid of grey values: they are kept for comparison.
"""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.measurement.locators.locator import Located, Seen, Windows, noise_of, windows_of
from grabberd.core.measurement.noise import LEAST_NOISE, binary_sigma_px

VERNIER_CURVED = (0.02, 0.06)
"""Error in x, y of a straight line between two samples of a curved edge: frame pixels, measured."""
PARABOLA_CURVED = (0.02, 0.03)
"""Error in x, y of a parabola through three samples of a peak that is no parabola: frame pixels, measured."""
PARABOLA_NOISE = 1.3
"""Noise of the correlation's peak, in units of the Cramér–Rao bound."""


def locate_by_vernier(seen: Seen) -> Located:
    """Locate half-way between the two positions where a blob's profile crosses half its height.

    The profile along x is the sum over a window's lines, that along y the sum over its columns. Crossings are
    interpolated linearly.
    """
    windows = windows_of(seen)
    signal = _signal(windows)
    noise = _noise_levels(seen)
    x = _crossings(signal.sum(axis=1), noise * signal.shape[1] ** 0.5)
    y = _crossings(signal.sum(axis=2), noise * signal.shape[2] ** 0.5)
    sigma = np.hypot(np.stack([x.sigma, y.sigma * windows.lines_apart], axis=1), VERNIER_CURVED)
    return _located(seen, windows, np.stack([x.middle, y.middle * windows.lines_apart], axis=1), sigma)


def locate_by_tian_huhns(seen: Seen) -> Located:
    """Locate by the peak of a blob's correlation with its own point reflection, interpolated by parabolas.

    A disc is its own reflection about its centre, so the peak lies at twice the centre and no template is
    needed. Parabolas through the highest sample and its two neighbours give its position between the samples.
    """
    windows = windows_of(seen)
    signal = _signal(windows)
    twice = _peaks(_self_convolved(signal))
    xy_px = twice / 2 * (1.0, windows.lines_apart)
    height = np.maximum(signal.max(axis=(1, 2), initial=1.0), 1.0)
    radius = np.sqrt(seen.area_px[windows.blob] / np.pi)
    spread = seen.settings.spread_px
    bound = _noise_levels(seen) / height * np.sqrt(2 * spread * windows.lines_apart / (np.pi**0.5 * radius))
    sigma = np.hypot(PARABOLA_NOISE * bound[:, np.newaxis], PARABOLA_CURVED)
    return _located(seen, windows, xy_px, sigma)


def _located(seen: Seen, windows: Windows, xy_px: Array, sigma: Array) -> Located:
    """Assign σ; at 1 bit noise is negligible beside quantisation."""
    if seen.packed.bits == 1:
        sigma = binary_sigma_px(seen.area_px[windows.blob], windows.lines_apart, doubled=False)
    centres, sigma_px = windows.located(seen, xy_px[:, 0], xy_px[:, 1], sigma)
    return Located(centres, sigma_px)


def _signal(windows: Windows) -> Array:
    """Grey values above each window's background."""
    above = windows.grey - windows.background[:, np.newaxis, np.newaxis]
    return above.astype(np.float64)


def _noise_levels(seen: Seen) -> float:
    """Standard deviation of a pixel in grey values, quantisation included."""
    rounding = LEAST_NOISE * (256 >> seen.packed.bits)
    return rounding if seen.packed.bits == 1 else float(np.hypot(noise_of(seen), rounding))


class _Crossings(NamedTuple):
    """Middle between the crossings of N profiles, and its standard deviation, in samples."""

    middle: Array
    sigma: Array


def _crossings(profile: Array, noise: float) -> _Crossings:
    """Find the half-height crossings of profiles (N, n) whose samples have this noise."""
    count, last = profile.shape[0], profile.shape[1] - 1
    half = profile.max(axis=1, initial=0.0) / 2
    above = profile > half[:, np.newaxis]
    first = above.argmax(axis=1).clip(1, last)
    end = (last - above[:, ::-1].argmax(axis=1)).clip(0, last - 1)
    which = np.arange(count)
    left = _crossing(profile[which, first - 1], profile[which, first], half)
    right = _crossing(profile[which, end + 1], profile[which, end], half)
    middle = (first - left[0] + end + right[0]) / 2
    return _Crossings(middle, noise / 2 * np.hypot(left[1], right[1]))


def _crossing(outer: Array, inner: Array, half: Array) -> tuple[Array, Array]:
    """Distance of the crossing outside the inner sample, and its σ for a noise of 1."""
    rise = np.maximum(inner - outer, 1e-9)
    share = ((inner - half) / rise).clip(0.0, 1.0)
    return share, np.hypot(share, 1 - share) / rise


def _self_convolved(signal: Array) -> Array:
    """(N, 2h − 1, 2w − 1) self-convolution of windows (N, h, w), indexed by the sum of two positions."""
    # Padded to the full length, or the convolution would wrap around.
    size = (2 * signal.shape[1] - 1, 2 * signal.shape[2] - 1)
    transformed = np.fft.rfft2(signal, size)
    return np.fft.irfft2(transformed * transformed, size)


def _peaks(correlation: Array) -> Array:
    """(N, 2) x, y of the highest samples, refined by parabolas except at the edges."""
    count, rows, columns = correlation.shape
    highest = correlation.reshape(count, rows * columns).argmax(axis=1)
    y, x = np.divmod(highest, columns)
    which, inner_y, inner_x = np.arange(count), y.clip(1, rows - 2), x.clip(1, columns - 2)
    along = [correlation[which, inner_y, inner_x + step] for step in (-1, 0, 1)]
    down = [correlation[which, inner_y + step, inner_x] for step in (-1, 0, 1)]
    return np.stack([inner_x + _vertex(*along), inner_y + _vertex(*down)], axis=1)


def _vertex(before: Array, here: Array, after: Array) -> Array:
    """Vertex of the parabola through three evenly spaced samples, from the middle one."""
    bend = 2 * here - before - after
    vertex: Array = np.where(bend > 0, (after - before) / np.where(bend > 0, 2 * bend, 1.0), 0.0)
    return vertex.clip(-1.0, 1.0)
