"""Edge locator: an ellipse through the points where a blob's grey value passes half its height."""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.measurement.locators.locator import (
    GREY,
    Located,
    Seen,
    Windows,
    meant_for,
    noise_of,
    windows_of,
)

LOWEST, HIGHEST = 0.03, 0.97
"""Shares of a blob's height between which the slope of its edge carries information."""
PEAK = 0.95
"""Ratio of a blob's height to its brightest pixel, which noise makes too bright."""
EXCESS = np.array([0.7, 1.4])
"""Ratio of measured to predicted σ of x, y: neighbouring crossings are not independent."""
BELIEF = 1e-3
"""Weight of a prior circle around the middle of the window, for edges with too few points."""


class _Edge(NamedTuple):
    """Crossings of an edge between adjacent pixels, (N, P) each; `weight` is 0 where there is none.

    Attributes:
        x: Columns from the window's middle.
        y: Frame lines from the window's middle.
        weight: Square of the slope there, in blob heights per pixel.
    """

    x: Array
    y: Array
    weight: Array


def locate_by_edge(seen: Seen) -> Located:
    """Locate by a conic fitted to the points where lines and columns cross the edge, by weighted least
    squares.

    Under a Gaussian spread the edge is its integral, nearly a logistic curve: its log odds are straight
    across the edge, so a crossing between two pixels can be interpolated linearly.

    Raises:
        InputError: The field has 1 bit.
    """
    meant_for(seen, "edge", GREY)
    windows = windows_of(seen)
    contrast = np.maximum(PEAK * (windows.grey.max(axis=(1, 2)) - windows.background), 1.0).astype(np.float64)
    above = windows.grey - windows.background[:, np.newaxis, np.newaxis]
    centre, sigma = _ellipses(_edges(windows, above / contrast[:, np.newaxis, np.newaxis]))
    x, y = centre[:, 0] + windows.x_px[-1] / 2, centre[:, 1] + windows.y_px[-1] / 2
    return Located(*windows.located(seen, x, y, sigma * noise_of(seen) / contrast[:, np.newaxis]))


def _edges(windows: Windows, height: Array) -> _Edge:
    share = height.clip(LOWEST, HIGHEST)
    odds = np.log(share / (1.0 - share))
    x, y = ((axis - axis[-1] / 2).astype(np.float64) for axis in (windows.x_px, windows.y_px))
    along, along_weight = _passed(odds[:, :, :-1], odds[:, :, 1:], x)
    down, down_weight = _passed(odds[:, :-1].swapaxes(1, 2), odds[:, 1:].swapaxes(1, 2), y)
    return _Edge(
        _side_by_side(along, np.broadcast_to(x[:, np.newaxis], down.shape)),
        _side_by_side(np.broadcast_to(y[:, np.newaxis], along.shape), down),
        _side_by_side(along_weight, down_weight),
    )


def _passed(before: Array, after: Array, axis_px: Array) -> tuple[Array, Array]:
    """Zero crossings of log odds between neighbours on the last axis, with their weights."""
    step = axis_px[1] - axis_px[0]
    passing = (before > 0) != (after > 0)
    rise = np.where(passing, after - before, 1.0)
    weight = np.where(passing, (rise / (4.0 * step)) ** 2, 0.0)
    return np.where(passing, axis_px[:-1] - before / rise * step, 0.0), weight


def _side_by_side(one: Array, other: Array) -> Array:
    return np.concatenate(
        [part.reshape(len(part), part.shape[1] * part.shape[2]) for part in (one, other)], axis=1
    )


def _ellipses(edge: _Edge) -> tuple[Array, Array]:
    """Centres (N, 2) of x² + y² + p (x² − y²) + q x y + d x + e y + f = 0, and their σ for noise 1.

    A point off the edge by δ causes an error of 2 R δ in this equation.
    """
    x, y = edge.x, edge.y
    radius2 = x * x + y * y
    total = np.maximum(edge.weight.sum(axis=1), BELIEF)
    weight = edge.weight / (4.0 * np.maximum((edge.weight * radius2).sum(axis=1) / total, 1.0))[:, np.newaxis]
    design = np.stack([x * x - y * y, x * y, x, y, np.ones_like(x)], axis=1)
    weighted = design * weight[:, np.newaxis]
    inverse = np.linalg.inv(weighted @ design.swapaxes(1, 2) + BELIEF * np.eye(5))
    p, q, d, e, _ = -(inverse @ (weighted @ radius2[:, :, np.newaxis]))[:, :, 0].T
    scale = 4.0 * (1.0 - p * p) - q * q
    # Near 0 the conic is no ellipse any more; 4 is the value of a circle.
    scale = np.where(np.abs(scale) > 1.0, scale, 4.0)
    centre = (
        np.stack([q * e - 2.0 * (1.0 - p) * d, q * d - 2.0 * (1.0 + p) * e], axis=1) / scale[:, np.newaxis]
    )
    sigma = 0.5 * EXCESS * np.sqrt(np.stack([inverse[:, 2, 2], inverse[:, 3, 3]], axis=1))
    return centre, sigma
