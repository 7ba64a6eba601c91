"""Threshold map for uneven light; and the apparent size of targets, on which thresholds depend."""

from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field, quantise
from grabberd.core.measurement.background import background_of
from grabberd.core.measurement.labelling.labels import by_component
from grabberd.core.measurement.labelling.runs import find_runs
from grabberd.core.measurement.labelling.shapes import shapes_of
from grabberd.core.measurement.threshold.threshold import (
    DOUBLED,
    ThresholdRule,
    contrast_levels,
    height_levels,
    trinder_levels,
)
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]

PARTS_X, PARTS_Y = 8, 6
"""Parts into which the picture is divided, large enough that each shows some targets."""
DEGREE = 3
"""Degree of the polynomial in x and y that describes light and background."""
STIFFNESS = 0.02
"""Regularisation per part that keeps the polynomial flat where few parts say otherwise."""
LEAST_DIAMETER_PX = 2.0
ALIKE = 0.35
"""Relative difference from the median diameter within which a blob counts as a target."""


class _Parts(NamedTuple):
    """Background and contrast in the P parts of a picture that show targets, (P,) each.

    Attributes:
        x: Middle of the part, from −1 to 1 over the picture.
        y: Likewise.
        level: Grey value of the background.
        noise: Its standard deviation.
        contrast: Height of the targets above it.
    """

    x: Array
    y: Array
    level: Array
    noise: Array
    contrast: Array


def threshold_map(
    luma: NDArray[np.uint8], rule: ThresholdRule, bits: int, lines: tuple[int, int] = DOUBLED
) -> NDArray[np.uint8]:
    """Compute a threshold for every pixel from smooth surfaces of background and contrast.

    Args:
        luma: (rows, columns) uint8, 8 bits.
        rule: Rule for choosing a threshold under even light.
        bits: Bits that the picture will be quantised to.
        lines: Of the fields at quantisation: `DOUBLED`, `INTACT` or `WHOLE`.

    Returns:
        (rows, columns) uint8.

    Raises:
        MeasurementError: No part of the picture shows targets.
    """
    if rule.kind == "fixed":
        assert rule.value is not None
        return np.full(luma.shape, rule.value, np.uint8)
    parts = _parts_of(luma)
    level, contrast = _surface(parts, parts.level, luma.shape), _surface(parts, parts.contrast, luma.shape)
    if rule.kind == "trinder":
        height = np.full(luma.shape, trinder_levels(rule.spread_px, rule.target_px))
    else:
        usual, noise = float(np.median(parts.contrast)), float(np.median(parts.noise))
        height = contrast * (height_levels(usual, noise, rule, bits, lines) / usual)
    thresholds: NDArray[np.uint8] = np.clip(np.rint(level + height), 0, 254).astype(np.uint8)
    return thresholds


def _parts_of(luma: NDArray[np.uint8]) -> _Parts:
    parts = []
    for y, band in enumerate(np.array_split(luma, PARTS_Y)):
        for x, part in enumerate(np.array_split(band, PARTS_X, axis=1)):
            histogram = np.bincount(part.ravel(), minlength=256)
            background = background_of(histogram)
            with suppress(MeasurementError):
                contrast = contrast_levels(histogram, background)
                middle = (2 * x + 1) / PARTS_X - 1, (2 * y + 1) / PARTS_Y - 1
                parts.append((*middle, background.level, background.noise, contrast))
    if not parts:
        raise MeasurementError(
            f"no targets stand out in any of {PARTS_X} by {PARTS_Y} parts of the picture",
            "look at the preview: light, lens cap, iris; or set a fixed threshold",
        )
    return _Parts(*np.array(parts).T)


def _surface(parts: _Parts, values: Array, shape: tuple[int, ...]) -> Array:
    """Polynomial through the parts' values over the whole picture; never below half of the least."""
    mean = values.mean()
    along_x, along_y = _powers(parts.x), _powers(parts.y)
    terms = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1) if i + j <= DEGREE]
    design = np.stack([along_x[i] * along_y[j] for i, j in terms], axis=1)
    held = STIFFNESS * len(values) * np.diag([float(i + j > 0) for i, j in terms])
    factor = np.linalg.solve(design.T @ design + held, design.T @ (values - mean))
    matrix = np.zeros((DEGREE + 1, DEGREE + 1))
    for (i, j), value in zip(terms, factor, strict=True):
        matrix[j, i] = value
    # From the middle of the first pixel to that of the last, as the parts' middles are given.
    columns, rows = (np.linspace(-1 + 1 / size, 1 - 1 / size, size) for size in shape[::-1])
    surface = np.stack(_powers(rows), axis=1) @ matrix @ np.stack(_powers(columns)) + mean
    limited: Array = np.maximum(surface, values.min() / 2)
    return limited


def _powers(t: Array) -> list[Array]:
    """Legendre polynomials up to `DEGREE`."""
    return [np.polynomial.Legendre.basis(degree)(t) for degree in range(DEGREE + 1)]


def with_seen_size(rule: ThresholdRule, field: Field) -> ThresholdRule:
    """Adapt a rule to the target size seen in a field: discs of the area above half the contrast.

    Raises:
        MeasurementError: No targets stand out.
    """
    histogram = np.bincount(field.luma.ravel(), minlength=256)
    background = background_of(histogram)
    half = round(background.level + contrast_levels(histogram, background) / 2)
    runs = find_runs(quantise(field, 1, min(half, 254)).data[0])
    shapes = shapes_of(*by_component(runs))
    diameter = np.sqrt(4 / np.pi * shapes.pixels * field.y_step)
    large = diameter[diameter >= LEAST_DIAMETER_PX]
    if not large.size:
        raise MeasurementError(
            f"none of the {len(diameter)} blobs seen is {LEAST_DIAMETER_PX:.0f} px wide",
            "look at the preview: light, focus; or set a fixed threshold",
        )
    median = np.median(large)
    alike = diameter[np.abs(diameter / median - 1) < ALIKE]
    return replace(rule, target_px=float(np.sqrt(np.mean(alike**2))))
