"""Correlation locator: normalised cross-correlation with the field's typical disc, sub-pixel by parabola."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices
from grabberd.core.measurement.locators.locator import (
    GREY,
    Located,
    Seen,
    Windows,
    meant_for,
    noise_of,
    windows_of,
)
from grabberd.core.measurement.locators.template import (
    BLURRED_PX,
    BLURRING,
    CONTRAST,
    HALF_HEIGHT,
    HALF_WIDTH,
    PIXEL,
    ROW,
    X,
    Y,
    disc_images,
)

STEP_PX = 0.25
ACROSS = 6
"""Steps either side of a window's middle in x; twice as many in y, since lines are two apart."""
PARABOLA = 2
"""Steps from a parabola's vertex to its arms."""
LEAST = np.float32(1e-6)

Single = NDArray[np.float32]


class _Templates(NamedTuple):
    """Images of the disc at (T_y, T_x) positions.

    Attributes:
        x_px: (T_x,) positions, columns from the window's first.
        y_px: (T_y,) positions, frame lines from the window's first.
        normed: (T_y · T_x, pixels) images without mean, of norm 1.
        slope2: (2,) sums of squared derivatives by x and y at the middle position, for contrast 1.
        norm: Norm of the disc at the middle position, for contrast 1.
    """

    x_px: Single
    y_px: Single
    normed: Single
    slope2: Single
    norm: float


def locate_by_correlation(seen: Seen) -> Located:
    """Locate each blob where the image of a disc resembles it most; one disc size for all.

    Noise: s = sn / (C √Σm′²), with m′ the derivative of the disc's image.

    Raises:
        InputError: The field has 1 bit.
    """
    meant_for(seen, "correlation", GREY)
    windows, noise = windows_of(seen), noise_of(seen)
    xy_px, sigma = np.zeros((len(windows.blob), 2), np.float32), np.zeros((len(windows.blob), 2), np.float32)
    apart = windows.lines_apart
    regular = np.array([windows.x_px[-1] // 2, windows.y_px[-1] / 2 // apart * apart])
    displaced = np.abs(windows.middle - regular).max(axis=1, keepdims=True) > apart
    middles = np.where(displaced, np.rint(windows.middle), regular)
    usual, group = np.unique(middles, axis=0, return_inverse=True)
    for index, middle in enumerate(usual):
        own = group.ravel() == index
        xy_px[own], sigma[own] = _located(windows.grey[own], _templates(seen, windows, middle))
    return Located(*windows.located(seen, xy_px[:, 0], xy_px[:, 1], noise * sigma))


def _located(grey: Single, templates: _Templates) -> tuple[Single, Single]:
    """Positions (N, 2) in windows (N, h, w), and their σ for noise 1."""
    flat = grey.reshape(len(grey), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    product = (flat @ templates.normed.T).reshape(-1, len(templates.y_px), len(templates.x_px))
    row, column = _greatest(product)
    blob = np.arange(len(product))
    x = templates.x_px[column] + STEP_PX * _vertex(product[blob, row], column)
    y = templates.y_px[row] + STEP_PX * _vertex(product[blob, :, column], row)
    contrast = np.maximum(product[blob, row, column] / templates.norm, LEAST)
    return np.stack([x, y], axis=1), 1 / (contrast[:, np.newaxis] * np.sqrt(templates.slope2))


def _templates(seen: Seen, windows: Windows, middle: Array) -> _Templates:
    x = (middle[0] + STEP_PX * np.arange(-ACROSS, ACROSS + 1)).astype(np.float32)
    y = (middle[1] + STEP_PX * np.arange(-2 * ACROSS, 2 * ACROSS + 1)).astype(np.float32)
    discs = np.zeros((8, len(y), len(x)), np.float32)
    discs[X], discs[Y], discs[CONTRAST] = x, y[:, np.newaxis], 1.0
    discs[HALF_WIDTH], discs[HALF_HEIGHT] = _typical_half_axes(seen, windows)
    spread2 = seen.settings.spread_px**2
    discs[BLURRING] = spread2 + ROW
    images, slopes = disc_images(discs.reshape(8, -1), windows.x_px, windows.y_px, spread2 + PIXEL)
    flat = images.reshape(len(images), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    norm = np.sqrt((flat * flat).sum(axis=1, keepdims=True)) + LEAST
    centre = len(flat) // 2
    slope2 = (slopes[centre, (X, Y)] ** 2).sum(axis=(1, 2)) + LEAST
    return _Templates(x, y, flat / norm, slope2, float(norm[centre, 0]))


def _typical_half_axes(seen: Seen, windows: Windows) -> tuple[float, float]:
    """Half axes in frame pixels: as set, or those of the field's median blob."""
    if seen.settings.target_px is not None:
        return seen.settings.target_px / 2, seen.settings.target_px / 2
    shapes, blob = seen.shapes, windows.blob
    if not len(blob):
        return 1.0, 1.0
    columns = np.median(shapes.last_column[blob] - shapes.first_column[blob] + 1)
    rows = np.median(shapes.last_row[blob] - shapes.first_row[blob] + 1)
    half_axes = (float(extent) / 2 - BLURRED_PX for extent in (columns, rows * seen.packed.y_step))
    across, down = (max(half, 1.0) for half in half_axes)
    return across, down


def _greatest(product: Single) -> tuple[Indices, Indices]:
    """(N,) row and column of each blob's greatest correlation, with room for the parabola's arms."""
    inner = product[:, PARABOLA:-PARABOLA, PARABOLA:-PARABOLA]
    row, column = np.unravel_index(inner.reshape(len(product), -1).argmax(axis=1), inner.shape[1:])
    return row + PARABOLA, column + PARABOLA


def _vertex(values: Single, at: Indices) -> Single:
    """(N,) vertex of a parabola through three of the values (N, T), in steps from `at`."""
    blob = np.arange(len(values))
    before, here, after = (values[blob, at + step] for step in (-PARABOLA, 0, PARABOLA))
    bend = np.minimum(before - 2 * here + after, -LEAST)
    return PARABOLA * (0.5 * (before - after) / bend).clip(-1, 1)
