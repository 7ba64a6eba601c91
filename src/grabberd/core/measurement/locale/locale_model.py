"""Model of a target's appearance: how likely each pixel is to be set, by its position relative to the target.

A disc is a stack of chords, blurred by a Gaussian and by the pixels that collect the light. All lengths are
in frame pixels, light is in units of the contrast.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHORDS = 20
LINE_HEIGHT_PX = 1.6
"""Compromise between a field's row that collects one frame line and a sensor that integrates two."""
SURE = 6.9
"""Greatest log odds of a pixel: one in a thousand is wrong for reasons outside the model."""
_NEWTON_STEPS = 6


class Appearance(NamedTuple):
    """Properties other than position that decide the bits of a target.

    Attributes:
        half_width_px: Half the width of the region above the threshold.
        half_height_px: Half its height.
        fraction: The threshold's share of the contrast.
        noise: Standard deviation of a pixel on a delivered line, in contrasts.
        spread_px: Standard deviation of the spread function.
        jitter_px: Standard deviation of a line's shift.
        y_step: Frame lines from row to row.
        lines_apart: Frame lines from one delivered line to the next: rows between them are interpolated.
    """

    half_width_px: float
    half_height_px: float
    fraction: float
    noise: float
    spread_px: float
    jitter_px: float
    y_step: int
    lines_apart: int = 2

    @property
    def doubled(self) -> bool:
        """True if every other row is interpolated."""
        return self.y_step < self.lines_apart

    def of_size(self, half_width_px: float, half_height_px: float) -> "Appearance":
        """The same for targets of another size."""
        return Appearance(half_width_px, half_height_px, *self[2:])

    @property
    def blur_px(self) -> tuple[float, float]:
        """Standard deviation of spread and pixel combined, in x and y."""
        pixel = 12**-0.5
        height_px = 1.0 if self.lines_apart == 1 else LINE_HEIGHT_PX
        return math.hypot(self.spread_px, pixel), math.hypot(self.spread_px, height_px * pixel)


def normal_share(z: Array) -> Array:
    """Normal distribution function, accurate to 2e-4."""
    return 1 / (1 + np.exp(-normal_log_odds(np.clip(z, -8.0, 8.0))))


def normal_log_odds(z: Array) -> Array:
    """Log odds of a standard normal variable being below z, by the usual cubic approximation."""
    return z * (1.5976 + 0.070566 * z * z)


def light(half_axes_px: tuple[float, float], blur_px: tuple[float, float], x: Array, y: Array) -> Array:
    """(len(y), len(x)) light of an ellipse around the origin at the points of a grid."""
    half_width, half_height = half_axes_px
    angle = (np.arange(CHORDS) + 0.5) * (np.pi / CHORDS) - np.pi / 2
    height, reach = half_height * np.sin(angle), half_width * np.cos(angle)
    x = x[:, np.newaxis]
    along = normal_share((x + reach) / blur_px[0]) - normal_share((x - reach) / blur_px[0])
    thickness = half_height * np.cos(angle) * (np.pi / CHORDS)
    across = np.exp(-0.5 * ((y[:, np.newaxis] - height) / blur_px[1]) ** 2) * thickness
    picture: Array = across @ along.T / (blur_px[1] * math.sqrt(2 * math.pi))
    return picture


@lru_cache(maxsize=256)
def half_axes_px(
    seen_px: tuple[float, float], fraction: float, blur_px: tuple[float, float]
) -> tuple[float, float]:
    """Half axes of the ellipse whose light falls to `fraction` at the half axes seen."""
    wanted = np.array(seen_px)
    axes, origin = wanted.copy(), np.zeros(1)
    # A fixed slope, a little below the .40/σ of a straight edge: converging needs no derivative.
    slope = 0.35 / np.array(blur_px)
    for _ in range(_NEWTON_STEPS):
        both = (float(axes[0]), float(axes[1]))
        right = light(both, blur_px, wanted[:1], origin)[0, 0]
        below = light(both, blur_px, origin, wanted[1:])[0, 0]
        axes = np.maximum(axes + (fraction - np.array([right, below])) / slope, 0.5)
    return float(axes[0]), float(axes[1])


class Odds(NamedTuple):
    """Log odds of a pixel being set, by its position relative to the target.

    Attributes:
        delivered: (V, U) for rows that the camera delivered.
        interpolated: (V, U) for rows that are the mean of their neighbours, one frame line away each.
    """

    delivered: Array
    interpolated: Array


def log_odds(seen: Appearance, x: Array, y: Array) -> Odds:
    """Compute log odds over an even grid of pixel positions relative to the target's centre, U in x, V in y.

    A frame line is a whole number of grid steps.
    """
    axes = half_axes_px((seen.half_width_px, seen.half_height_px), seen.fraction, seen.blur_px)
    line = round(1 / (y[1] - y[0]))
    beyond = np.arange(1, line + 1) / line
    further = np.concatenate([y[0] - beyond[::-1], y, y[-1] + beyond])
    picture = light(axes, seen.blur_px, x, further)
    step = float(x[1] - x[0])
    return Odds(
        _odds_of(picture[line:-line], step, seen, 1.0),
        _odds_of((picture[: -2 * line] + picture[2 * line :]) / 2, step, seen, 0.5),
    )


def _odds_of(picture: Array, step_px: float, seen: Appearance, share: float) -> Array:
    """Log odds with the threshold blurred by noise and the row's shift; a mean of two rows halves the
    variance.
    """
    shifted = np.gradient(picture, step_px, axis=1) * seen.jitter_px
    deviation = np.sqrt(share * (seen.noise**2 + shifted * shifted))
    z = np.clip((picture - seen.fraction) / deviation, -4.0, 4.0)
    return np.clip(normal_log_odds(z), -SURE, SURE)
