"""Template locator: least squares with the image of a disc in space, eight parameters per target.

The image is an ellipse that falls off along the normal of its edge like the integral of the spread function,
whose width differs along and across the lines. That is exact for a straight edge; the effect of curvature is
symmetrical and so does not affect the position. The error is as small as the noise allows (the Cramér–Rao
bound).
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.measurement.locators.centroid import moments, weights_of
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

X, Y, CONTRAST, BACKGROUND, HALF_WIDTH, HALF_HEIGHT, LEAN, BLURRING = range(8)
"""Parameters of a disc's image: centre, grey values, half axes, columns per line by which its chords lean,
and the variance of the spread function across the lines, which a camera's rows enlarge."""
PER_SIGMA = 512
"""Table entries per σ of the edge."""
REACH = 5.0
"""σ either side of the edge that the table covers."""

Single = NDArray[np.float32]


def disc_images(discs: Single, x_px: Single, y_px: Single, blurring_x: float) -> tuple[Single, Single]:
    """Compute the grey values of N discs and their derivatives.

    Args:
        discs: (8, N), in the order of the constants above.
        x_px: (w,) columns, from the same origin as the centres.
        y_px: (h,) frame lines, likewise.
        blurring_x: Variance of the spread function along the lines, pixels included.

    Returns:
        (N, h, w) grey values, and (N, 8, h, w) derivatives by the eight parameters.
    """
    x, y, contrast, background, half_width, half_height, lean, blurring_y = discs[:, :, np.newaxis]
    narrow, low = 1 / half_width, 1 / half_height
    v = np.repeat(y_px, len(x_px)) - y
    u = (np.tile(x_px, len(y_px)) - x - lean * v) * narrow
    down = v * low
    radius2 = u * u + down * down + np.float32(1e-6)
    across, along = u * narrow, down * low - lean * u * narrow
    along2 = along * along
    sharp = 1 / np.sqrt(np.float32(blurring_x) * (across * across) + blurring_y * along2 + np.float32(1e-6))
    distance = (radius2 - np.sqrt(radius2)) * sharp
    inside, density = _looked_up(distance)
    slopes = np.empty((discs.shape[1], 8, v.shape[1]), np.float32)
    edge = contrast * density * sharp
    slopes[:, X], slopes[:, Y] = edge * across, edge * along
    slopes[:, CONTRAST], slopes[:, BACKGROUND] = inside, 1.0
    slopes[:, HALF_WIDTH], slopes[:, HALF_HEIGHT] = edge * u * across, edge * down * down * low
    slopes[:, LEAN] = slopes[:, X] * v
    slopes[:, BLURRING] = np.float32(0.5) * edge * sharp * distance * along2
    shape = len(y_px), len(x_px)
    return (background + contrast * inside).reshape(-1, *shape), slopes.reshape(-1, 8, *shape)


def _looked_up(distance: Single) -> tuple[Single, Single]:
    """Look up an edge's profile and its slope at distances in σ.

    Both are continued by their slopes between entries: otherwise rounding would decide between two entries.
    """
    profile, slope = edge_table()
    place = (distance + np.float32(REACH)) * np.float32(PER_SIGMA) + np.float32(0.5)
    place = place.clip(0, len(profile) - 1)
    entry = place.astype(np.intp)
    beyond = (place - entry.astype(np.float32) - np.float32(0.5)) * np.float32(1 / PER_SIGMA)
    z = entry.astype(np.float32) * np.float32(1 / PER_SIGMA) - np.float32(REACH)
    density = slope.take(entry, mode="clip")
    inside = profile.take(entry, mode="clip") - density * beyond * (1 - np.float32(0.5) * z * beyond)
    return inside, density * (1 - z * beyond)


@cache
def edge_table() -> tuple[Single, Single]:
    """Profile of an edge and its slope, `PER_SIGMA` entries per σ from −REACH on."""
    z = np.arange(-REACH, REACH, 1 / PER_SIGMA)
    density = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
    inside = 1.0 - np.cumsum(density) / density.sum()
    return inside.astype(np.float32), density.astype(np.float32)


LONGEST_STEP = np.array([1.5, 1.5, np.inf, np.inf, 0.7, 0.7, 0.3, 0.3])
"""Limits of one step in each parameter: a wild step would lose the blob."""
PRIOR_SIGMA = (3.0, 3.0, 255.0, 255.0, 1.0, 1.0, 0.1, 0.3)
"""Prior σ about the start, since a faint blob cannot determine all eight parameters."""
SMALLEST_PX = 0.4
BLURRED_PX = 0.9
"""Distance by which pixels above a low threshold extend beyond the disc's edge."""
PIXEL, ROW = 1 / 12, 0.2
"""Variance added to the spread function by a pixel, and by a row of one line or the sum of two."""
VAGUEST_CHORD_PX = 0.5
"""Greatest σ of a chord that is used for line shifts."""
LEAST = 1e-6


class _Fit(NamedTuple):
    """Discs (8, N), their covariance (N, 8, 8), and at the fitted discs the residuals and slopes by x
    (N, h, w).
    """

    discs: Single
    covariance: Array
    residual: Single
    slope: Single


def locate_by_template(seen: Seen) -> Located:
    """Locate by fitting the image of a disc to the grey values around each blob.

    Raises:
        InputError: The field has 1 bit.
    """
    meant_for(seen, "template", GREY)
    windows, noise = windows_of(seen), noise_of(seen)
    fit = _fitted(windows, _start(seen, windows), seen.settings.spread_px**2 + PIXEL, noise)
    sigma = np.sqrt(fit.covariance[:, (X, Y), (X, Y)])
    centres, sigma_px = windows.located(seen, fit.discs[X], fit.discs[Y], sigma)
    return Located(centres, sigma_px, _chords(windows, fit, noise))


def _start(seen: Seen, windows: Windows) -> Single:
    """(8, N) start values from the moments of the squared grey values: a sharp disc's variance is R²/4."""
    discs = np.zeros((8, len(windows.blob)), np.float32)
    weight = weights_of(windows)
    discs[X], across2 = moments(weight.sum(axis=1), windows.x_px)
    discs[Y], down2 = moments(weight.sum(axis=2), windows.y_px)
    discs[HALF_WIDTH], discs[HALF_HEIGHT] = 2.0 * np.sqrt(across2), 2.0 * np.sqrt(down2)
    discs[BACKGROUND] = windows.background
    discs[CONTRAST] = windows.grey.max(axis=(1, 2)) - discs[BACKGROUND]
    discs[BLURRING] = seen.settings.spread_px**2 + ROW
    return discs


def _fitted(windows: Windows, start: Single, blurring_x: float, noise: float) -> _Fit:
    """Take one Gauss–Newton step for all discs at once: the moments are a sufficiently good start."""
    image, slopes = disc_images(start, windows.x_px, windows.y_px, blurring_x)
    residual = windows.grey - image
    count, pixels = len(slopes), residual[0].size if len(residual) else 1
    design = slopes.reshape(count, 8, pixels)
    prior = (noise / np.array(PRIOR_SIGMA)) ** 2
    normal = (design @ design.swapaxes(1, 2)).astype(np.float64) + np.diag(prior)
    inverse = np.linalg.inv(normal)
    right = design @ residual.reshape(count, pixels, 1)
    step = (inverse @ right)[:, :, 0].clip(-LONGEST_STEP, LONGEST_STEP).astype(np.float32)
    discs = start + step.T
    discs[HALF_WIDTH : HALF_HEIGHT + 1] = np.maximum(discs[HALF_WIDTH : HALF_HEIGHT + 1], SMALLEST_PX)
    # Against the upright disc of the start, the chords of one that leans are off alike in every field, by up
    # to .04 px at its ends (docs/decisions/measurement.md).
    image, slopes = disc_images(discs, windows.x_px, windows.y_px, blurring_x)
    return _Fit(discs, (inverse * noise**2).astype(np.float64), windows.grey - image, slopes[:, X])


def _chords(windows: Windows, fit: _Fit, noise: float) -> Chords:
    """Chords from each line's own least-squares shift against the disc; its share is that of the weight."""
    weight = (fit.slope * fit.slope).sum(axis=2).astype(np.float64)
    own = (fit.slope * fit.residual).sum(axis=2) / np.maximum(weight, LEAST)
    beside = windows.y_px - fit.discs[Y][:, np.newaxis]
    along = fit.discs[X][:, np.newaxis] + fit.discs[LEAN][:, np.newaxis] * beside
    precision = weight / noise**2
    sure = precision > VAGUEST_CHORD_PX**-2
    return Chords(
        blob=windows.blob,
        line=windows.line,
        centre=windows.column[:, np.newaxis] + (along + own).astype(np.float64),
        weight=np.where(sure, precision, 0.0),
        share=weight / np.maximum(weight.sum(axis=1, keepdims=True), LEAST),
    ).trimmed(sure)
