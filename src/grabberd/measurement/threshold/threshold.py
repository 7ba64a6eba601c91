"""The grey value that separates targets from the background (paper 3.5 and eq. 3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError
from grabberd.measurement.background import Background, background_of
from grabberd.measurement.locale.locale_prediction import Scene, best_fraction

KINDS = ("fixed", "trinder", "automatic")

GREY_FRACTION = 0.13
"""Of the contrast, with 2 bits and more: five times better in y than one half."""
NOISE_MARGIN = 4.0
"""A threshold is at least so many standard deviations above the background."""
SURELY_BRIGHT = 6.0
"""Pixels more standard deviations above the background than this are not noise."""
PLATEAU_QUANTILE = 0.85
"""Of the bright pixels: above it they are a target's inside, below it its blurred edge."""
LEAST_BRIGHT_SHARE = 5e-5
"""Of the picture: a lone target of 5 px has .0001 of it."""
LEAST_CONTRAST_LEVELS = 12.0


@dataclass(frozen=True, slots=True)
class ThresholdRule:
    """How a threshold is chosen.

    Attributes:
        kind: "fixed": `value`; "trinder": background + 74 SF^1.3 / A (paper eq. 3); "automatic": a fraction
            of the contrast that is found in the picture.
        value: grey value of a fixed threshold.
        spread_px: standard deviation of the spread function; SF is twice that.
        target_px: the target's diameter A, frame pixels.
        fraction: of the contrast, for "automatic"; None: at 1 bit the one with the least predicted error for
            this spread and diameter, with more bits `GREY_FRACTION`.
        line_jitter_px: standard deviation of a line's shift, which the predicted error includes.

    Raises:
        ValueError: an unknown kind, a fixed rule without its value, or numbers out of range.
    """

    kind: str = "automatic"
    value: int | None = None
    spread_px: float = 0.7
    target_px: float = 5.0
    fraction: float | None = None
    line_jitter_px: float = 0.12

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind {self.kind!r} is none of {', '.join(KINDS)}")
        if self.kind == "fixed" and (self.value is None or not 0 <= self.value <= 254):
            raise ValueError(f"a fixed threshold needs a value from 0 to 254, not {self.value}")
        if not (self.spread_px > 0 and self.target_px > 0):
            raise ValueError(f"spread_px {self.spread_px} and target_px {self.target_px} have to be positive")
        if self.fraction is not None and not 0 < self.fraction < 1:
            raise ValueError(f"fraction {self.fraction} is not between 0 and 1")


def choose_threshold(histogram: NDArray[np.integer], rule: ThresholdRule, bits: int, y_step: int = 1) -> int:
    """The threshold for a picture.

    Equation (3) gives grey values of an 8-bit picture whose background is black, so the background's level is
    added.

    Args:
        histogram: (256,) int, how often each grey value occurs in the 8-bit picture.
        rule: how.
        bits: with which the picture will be quantised.
        y_step: frame lines from row to row when it will be: 1 doubled, 2 intact.

    Returns:
        0 to 254.

    Raises:
        MeasurementError: automatic, and there are no targets to see.
    """
    if rule.kind == "fixed":
        assert rule.value is not None
        return rule.value
    if rule.kind == "trinder":
        height = trinder_levels(rule.spread_px, rule.target_px)
        return _whole(background_of(histogram).level + height)
    background = background_of(histogram)
    contrast = contrast_levels(histogram, background)
    return _whole(background.level + height_levels(contrast, background.noise, rule, bits, y_step))


def trinder_levels(spread_px: float, target_px: float) -> float:
    """T = 74 SF^1.3 / A in grey values above the background, SF = 2 `spread_px` (paper eq. 3)."""
    return float(74 * (2 * spread_px) ** 1.3 / target_px)


def height_levels(contrast: float, noise: float, rule: ThresholdRule, bits: int, y_step: int) -> float:
    """An automatic threshold above the background: all in grey values."""
    least = NOISE_MARGIN * noise
    if rule.fraction is not None or bits > 1:
        return max((rule.fraction or GREY_FRACTION) * contrast, least)
    scene = Scene(rule.target_px, rule.spread_px, noise / contrast, rule.line_jitter_px, y_step)
    return best_fraction(scene, least / contrast) * contrast


def contrast_levels(histogram: NDArray[np.integer], background: Background) -> float:
    """How far the targets' inside is above the background, in grey values.

    Raises:
        MeasurementError: too little is bright, or it is hardly brighter than the background.
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
