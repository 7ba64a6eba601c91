"""Prediction of the error at 1 bit by target size and threshold, from which the threshold is chosen.

A blob's height and width in rows and columns decide how well its position is known; a height of a
half-integer number of rows is bad. So the best threshold depends on the size seen.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.locale.locale import NOISES
from grabberd.core.measurement.locale.locale_model import Appearance, light, log_odds
from grabberd.core.measurement.locale.locale_patterns import Cuts
from grabberd.core.measurement.locale.locale_posterior import Entries, Posterior, likelihoods
from grabberd.core.measurement.locale.locale_table import STEPS_X, STEPS_Y, new_table

Array = NDArray[np.float64]

FRACTIONS = (0.12, 0.16, 0.2, 0.24, 0.28, 0.33, 0.4, 0.5)
"""Candidate thresholds, in contrasts."""
SIZES = (0.97, 1.03)
"""Relative sizes over which the error is averaged, because targets of one picture differ."""
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
    return min(allowed)[1] if allowed else max(least, FRACTIONS[-1])


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
    mean: Array = posterior.variance_px2.mean(axis=0)
    return mean


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
