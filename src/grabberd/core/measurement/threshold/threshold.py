"""Threshold: the grey value that separates targets from the background (paper 3.5 and eq. 3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.background import Background, background_of
from grabberd.core.measurement.locale.locale_prediction import Scene, best_fraction
from grabberd.errors import MeasurementError

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
