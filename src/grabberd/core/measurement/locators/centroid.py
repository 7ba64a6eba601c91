"""Centroid locators: the centroid of a blob's pixels (paper eqs. 1, 2), and one weighted with squared grey
values.

The first takes any number of bits. The second weights with the square of the grey value above the background,
which gives dark pixels, mostly noise, little weight; no threshold cuts anything off, so the centre does not
depend on how the rows fall on the blob.
"""

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.measurement.labelling import grey_centres
from grabberd.core.measurement.locators.locator import (
    GREY,
    Chords,
    Located,
    Seen,
    Windows,
    meant_for,
    noise_of,
    windows_of,
)
from grabberd.core.measurement.noise import background_in, binary_sigma_px, grey_sigma_px


def locate_by_centroid(seen: Seen) -> Located:
    """Locate by centroids, with all pixels weighted equally at 1 bit, and by g − T with more bits."""
    return _binary(seen) if seen.packed.bits == 1 else _grey(seen)


def _binary(seen: Seen) -> Located:
    packed = seen.packed
    return Located(seen.centroids, binary_sigma_px(seen.area_px, packed.y_step, doubled=packed.is_doubled))


def _grey(seen: Seen) -> Located:
    packed = seen.packed
    centres, weight = grey_centres(packed, seen.runs, seen.label, len(seen.shapes))
    background = background_in(packed)
    sigma = grey_sigma_px(
        seen.area_px,
        weight,
        packed.y_step,
        doubled=packed.is_doubled,
        noise=noise_of(seen),
        threshold_height=max(0.0, packed.threshold - background.level),
    )
    return Located(centres, sigma)


LEAST_SIGNAL = 40.0
"""Weight of a chord, in units of the squared noise, below which it may be noise alone."""
LEAST = np.float32(1e-6)

Single = NDArray[np.float32]


def locate_by_weighted(seen: Seen) -> Located:
    """Locate by centroids weighted with (g − b)² where g exceeds b, the median of the window.

    Noise: s = 2 sn √(V / Σ(g−b)²), with V the variance of the weights about the centroid.

    Raises:
        InputError: The field has 1 bit.
    """
    meant_for(seen, "weighted", GREY)
    windows, noise = windows_of(seen), noise_of(seen)
    weight = weights_of(windows)
    (x, x2), (y, y2) = moments(weight.sum(axis=1), windows.x_px), moments(weight.sum(axis=2), windows.y_px)
    total = weight.sum(axis=(1, 2))[:, np.newaxis]
    sigma = 2 * noise * np.sqrt(np.stack([x2, y2], axis=1) / (total + LEAST))
    centres, sigma_px = windows.located(seen, x, y, sigma)
    return Located(centres, sigma_px, _chords(windows, weight, noise))


def weights_of(windows: Windows) -> Single:
    """(N, h, w) squared grey values above the background, 0 below it."""
    height = windows.grey - windows.background[:, np.newaxis, np.newaxis]
    np.maximum(height, 0.0, out=height)
    height *= height
    return height


def moments(weight: Single, position_px: Single) -> tuple[Array, Array]:
    """Mean of the positions (w,) under weights (…, w), and their variance about it."""
    amount = weight.astype(np.float64)
    total = amount.sum(axis=-1) + LEAST
    mean = amount @ position_px / total
    return mean, np.maximum(amount @ (position_px * position_px) / total - mean * mean, LEAST)


def _chords(windows: Windows, weight: Single, noise: float) -> Chords:
    """Chords from each line's own centroid; its share is that of the blob's weight."""
    amount = weight.sum(axis=2).astype(np.float64)
    middle, variance = moments(weight, windows.x_px)
    precision = amount / (4 * noise**2 * variance)
    return Chords(
        blob=windows.blob,
        line=windows.line,
        centre=(windows.column[:, np.newaxis] + middle).astype(np.float64),
        weight=np.where(amount > LEAST_SIGNAL * noise**2, precision, 0.0),
        share=amount / (amount.sum(axis=1, keepdims=True) + LEAST),
    )
