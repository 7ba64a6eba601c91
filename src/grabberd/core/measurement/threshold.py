"""Threshold: the grey value that separates targets from the background (paper 3.5 and eq. 3), one for a field
or, in uneven light, one for every pixel.

At 1 bit the threshold of least predicted error is chosen: a blob's height and width in rows and columns
decide how well its position is known, and a height of a half-integer number of rows is bad. So the best one
depends on the size of the targets, which `with_seen_size` measures.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.field import Field, quantise
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of
from grabberd.core.measurement.locale import NOISES, Cuts, Entries, Posterior, likelihoods
from grabberd.core.measurement.locale_table import STEPS_X, STEPS_Y, Appearance, light, log_odds, new_table
from grabberd.core.measurement.noise import Background, background_of
from grabberd.errors import MeasurementError

FRACTIONS = (0.15, 0.18, 0.22, 0.26, 0.3, 0.36, 0.43, 0.5)
"""Candidate thresholds, in contrasts."""
SIZES = (0.92, 1.0, 1.08)
"""Relative sizes over which the error is averaged: targets of one picture lean or stand nearer."""
AS_GOOD = 1.045
"""Factor on the least predicted error up to which the lowest threshold is taken: of equals it loses less of
what leans or is dim."""
PARALLAX = 3.0
"""Weight of an error in x relative to y: x carries the parallax, and most of the error is in depth."""
EVERY_X, EVERY_Y = 2, 1
"""Steps between the table positions for which the error is predicted, each way."""


class Scene(NamedTuple):
    """Properties other than the threshold that decide the error at 1 bit.

    Attributes:
        target_px: Diameter of the discs, frame pixels.
        spread_px: Standard deviation of the spread function.
        noise: Standard deviation of a pixel, in contrasts.
        jitter_px: Standard deviation of a line's shift.
        y_step: Frame lines from row to row.
        lines_apart: Frame lines from one delivered line to the next: rows between them are interpolated.
    """

    target_px: float
    spread_px: float
    noise: float
    jitter_px: float
    y_step: int
    lines_apart: int = 2


def best_fraction(scene: Scene, least: float = 0.0) -> float:
    """Choose the threshold of least predicted error in space, in contrasts.

    Args:
        scene: Its size and noise are rounded, so that few predictions are needed.
        least: Lower thresholds are too close to the noise.
    """
    noise = min(NOISES, key=lambda one: abs(math.log(one / max(scene.noise, 1e-6))))
    errors = _errors(scene._replace(noise=noise, target_px=round(5 * scene.target_px) / 5))
    allowed = [pair for pair in zip(errors, FRACTIONS, strict=True) if pair[1] >= least]
    if not allowed:
        return max(least, FRACTIONS[-1])
    enough = AS_GOOD * min(allowed)[0]
    return next(fraction for error, fraction in allowed if error <= enough)


@lru_cache(maxsize=32)
def _errors(scene: Scene) -> tuple[float, ...]:
    """Predicted error of x and y combined at each of `FRACTIONS`."""
    predicted = (predicted_sigma_px(scene, fraction) for fraction in FRACTIONS)
    return tuple(math.hypot(PARALLAX * x, y) for x, y in predicted)


def predicted_sigma_px(scene: Scene, fraction: float) -> tuple[float, float]:
    """Predict the standard deviation of x and y by locale decoding, line jitter included in x.

    Noise-free images are decoded for positions all over a pixel and a row; the mean variance is the error.
    """
    variance = np.mean([_variance(scene, fraction, scene.target_px * size) for size in SIZES], axis=0)
    return math.sqrt(variance[0]), math.sqrt(variance[1])


def _variance(scene: Scene, fraction: float, diameter_px: float) -> Array:
    seen = _appearance(scene, fraction, diameter_px)
    one, cuts = new_table(seen), _cuts(seen)
    blobs = [len(cuts.first)]
    posterior = Posterior.of(likelihoods([one], blobs, Entries.of(cuts, [one.grid], blobs)), scene.y_step)
    return posterior.variance_px2.mean(axis=0)


def _appearance(scene: Scene, fraction: float, diameter_px: float) -> Appearance:
    """Appearance of a disc above the threshold; of size 0 if too small for it."""
    unknown = Appearance(1.0, 1.0, fraction, scene.noise, scene.spread_px, *scene[3:])
    out, origin = np.linspace(0.0, diameter_px, 200), np.zeros(1)
    half = (diameter_px / 2, diameter_px / 2)
    right = light(half, unknown.blur_px, out, origin)[0]
    below = light(half, unknown.blur_px, origin, out)[:, 0]
    width, height = (float(np.interp(-fraction, -profile, out)) for profile in (right, below))
    return unknown._replace(half_width_px=round(width, 2), half_height_px=round(height, 2))


def _cuts(seen: Appearance) -> Cuts:
    """Noise-free runs for positions all over two lines and a pixel; at least one pixel each."""
    y, x = np.mgrid[0 : 2 * STEPS_Y : EVERY_Y, 0:STEPS_X:EVERY_X].reshape(2, -1, 1, 1)
    row = _pixels(seen.half_height_px, seen.y_step * STEPS_Y)[:, np.newaxis]
    column = _pixels(seen.half_width_px, STEPS_X)
    u, v = np.arange(column[0] - STEPS_X, column[-1] + 1), np.arange(row[0, 0] - 2 * STEPS_Y, row[-1, 0] + 1)
    odds = np.stack(log_odds(seen, u / STEPS_X, v / STEPS_Y))
    interpolated = row // STEPS_Y % seen.lines_apart
    of_pixels = odds[interpolated, row - y - v[0], column - x - u[0]]
    is_set = of_pixels >= np.minimum(of_pixels.max(axis=(1, 2), keepdims=True), 0.0)
    blob, at_row = np.nonzero(is_set.any(axis=2))
    start = is_set[blob, at_row].argmax(axis=1)
    end = start + np.count_nonzero(is_set[blob, at_row], axis=1)
    return Cuts(
        first=np.searchsorted(blob, np.arange(len(is_set))),
        interpolated=interpolated[at_row, 0],
        row=row[at_row, 0] - y[blob, 0, 0],
        start=column[0] + start * STEPS_X - x[blob, 0, 0],
        end=column[0] + end * STEPS_X - x[blob, 0, 0],
        phase=-x[:, 0, 0],
    )


def _pixels(half_px: float, step: int) -> NDArray[np.int64]:
    """Pixels that may be set, wherever in a pixel the target lies."""
    beside = math.ceil((half_px + 1) * max(STEPS_X, STEPS_Y) / step) + 1
    return np.arange(-beside, beside + 1) * step


KINDS = ("fixed", "trinder", "automatic")

GREY_FRACTION = 0.13
"""Share of the contrast with 2 bits or more: 10 to 15 % is five times more accurate in y than one half."""
NOISE_MARGIN = 4.0
"""Least height of a threshold above the background, in standard deviations."""
SURELY_BRIGHT = 6.0
"""Height above the background, in standard deviations, beyond which a pixel is not noise."""
PLATEAU_QUANTILE = 0.85
"""Quantile of the bright pixels that separates a target's inside from its blurred edge."""
LEAST_BRIGHT_SHARE = 5e-5
"""Least share of bright pixels in a picture: a single target of 5 px has .0001."""
LEAST_CONTRAST_LEVELS = 12.0
DOUBLED, INTACT, WHOLE = (1, 2), (2, 2), (1, 1)
"""Lines of a field: frame lines from row to row, and from one delivered line to the next. Those of a
`WHOLE`, a progressive picture, do not shift."""


@dataclass(frozen=True, slots=True)
class ThresholdRule:
    """Rule for choosing a threshold.

    Attributes:
        kind: "fixed": `value`; "trinder": background + 74 SF^1.3 / A (paper eq. 3); "automatic": a fraction
            of the contrast found in the picture.
        value: Grey value of a fixed threshold.
        spread_px: Standard deviation of the spread function; SF is twice that.
        target_px: The target's diameter A, frame pixels.
        fraction: Fraction of the contrast for "automatic". None: at 1 bit the one with the least predicted
            error for this spread and diameter, with more bits `GREY_FRACTION`.
        line_jitter_px: Standard deviation of a line's shift, included in the predicted error.

    Raises:
        ValueError: The kind is unknown, a fixed rule has no value, or a number is out of range.
    """

    kind: str = "automatic"
    value: int | None = None
    spread_px: float = 0.7
    target_px: float = 5.0
    fraction: float | None = None
    line_jitter_px: float = 0.12

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind {self.kind!r}; choose from {', '.join(KINDS)}")
        if self.kind == "fixed" and (self.value is None or not 0 <= self.value <= 254):
            raise ValueError(f"a fixed threshold needs a value from 0 to 254, not {self.value}")
        if not (self.spread_px > 0 and self.target_px > 0):
            raise ValueError(f"spread_px {self.spread_px} and target_px {self.target_px} must be positive")
        if self.fraction is not None and not 0 < self.fraction < 1:
            raise ValueError(f"fraction {self.fraction} is not between 0 and 1")


def choose_threshold(
    histogram: NDArray[np.integer], rule: ThresholdRule, bits: int, lines: tuple[int, int] = DOUBLED
) -> int:
    """Choose the threshold for a picture.

    Equation (3) assumes an 8-bit picture with a black background, so the background's level is added.

    Args:
        histogram: (256,) int, frequency of each grey value in the 8-bit picture.
        rule: Rule to apply.
        bits: Bits that the picture will be quantised to.
        lines: Of the fields at quantisation: `DOUBLED`, `INTACT` or `WHOLE`.

    Returns:
        0 to 254.

    Raises:
        MeasurementError: The rule is automatic and no targets stand out.
    """
    if rule.kind == "fixed":
        assert rule.value is not None
        return rule.value
    if rule.kind == "trinder":
        height = trinder_levels(rule.spread_px, rule.target_px)
        return _whole(background_of(histogram).level + height)
    background = background_of(histogram)
    contrast = contrast_levels(histogram, background)
    return _whole(background.level + height_levels(contrast, background.noise, rule, bits, lines))


def trinder_levels(spread_px: float, target_px: float) -> float:
    """Compute T = 74 SF^1.3 / A in grey values above the background, SF = 2 `spread_px` (paper eq. 3)."""
    return float(74 * (2 * spread_px) ** 1.3 / target_px)


def height_levels(
    contrast: float, noise: float, rule: ThresholdRule, bits: int, lines: tuple[int, int]
) -> float:
    """Height of an automatic threshold above the background; all in grey values."""
    least = NOISE_MARGIN * noise
    if rule.fraction is not None or bits > 1:
        return max((rule.fraction or GREY_FRACTION) * contrast, least)
    jitter_px = 0.0 if lines == WHOLE else rule.line_jitter_px
    scene = Scene(rule.target_px, rule.spread_px, noise / contrast, jitter_px, *lines)
    return best_fraction(scene, least / contrast) * contrast


def contrast_levels(histogram: NDArray[np.integer], background: Background) -> float:
    """Measure the contrast of the targets' inside above the background, in grey values.

    Raises:
        MeasurementError: Too few pixels are clearly brighter than the background.
    """
    edge = int(np.ceil(background.level + max(SURELY_BRIGHT * background.noise, LEAST_CONTRAST_LEVELS)))
    cumulated = np.cumsum(histogram[edge:])
    bright = int(cumulated[-1]) if cumulated.size else 0
    if bright <= LEAST_BRIGHT_SHARE * int(histogram.sum()):
        raise MeasurementError(
            f"no targets stand out: {bright} of {int(histogram.sum())} pixels are above grey value {edge}, "
            f"the background is {background.level:.0f} with a noise of {background.noise:.1f}",
            "look at the preview: light, lens cap, iris; or set a fixed threshold",
        )
    plateau = edge + int(np.searchsorted(cumulated, PLATEAU_QUANTILE * bright))
    return plateau - background.level


def _whole(level: float) -> int:
    return int(np.clip(np.floor(level + 0.5), 0, 254))


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
    return np.clip(np.rint(level + height), 0, 254).astype(np.uint8)


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
    return np.maximum(surface, values.min() / 2)


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
