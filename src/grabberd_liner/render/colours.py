"""Colour scales for values, and the colour bar."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd_liner.render.canvas import INK, Canvas, Colour

Array = NDArray[np.float64]

UNKNOWN: Colour = (200, 200, 200)
"""Colour of unknown values."""
PLAIN: Colour = (226, 196, 158)
"""Colour of a surface without values."""

_STEPS = 64
_FEWEST_TICKS = 3


@dataclass(frozen=True, slots=True)
class Scale:
    """Range of values that a colour scale covers.

    Attributes:
        label: quantity and unit, in ASCII.
        low: value of the first colour; `high`: value of the last.
    """

    label: str
    low: float
    high: float

    @classmethod
    def over(cls, label: str, values: Array) -> "Scale":
        """Scale from the 2nd to the 98th percentile, so that single outliers do not flatten the colours."""
        known = values[np.isfinite(values)]
        low, high = np.percentile(known, [2, 98]) if len(known) else (0.0, 1.0)
        # A quantity that is the same everywhere needs some range, too: colours are shares of it.
        return cls(label, float(low), float(max(high, low + 1e-9 + 1e-6 * abs(low))))

    def colours(self, values: Array) -> Array:
        """(..., 3) blue, green, red, 0 to 255, of values (...); those beyond get the end colours."""
        share = np.clip((np.nan_to_num(values) - self.low) / (self.high - self.low), 0, 1)
        levels = np.round(share * 255).astype(np.uint8).reshape(-1, 1)
        mapped = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS).reshape(*values.shape, 3)
        return np.where(np.isfinite(values)[..., np.newaxis], mapped, UNKNOWN).astype(float)


def draw_bar(canvas: Canvas, scale: Scale) -> None:
    """Draws the colour bar along the right edge, with its values and its label."""
    left, right = canvas.width - 74.0, canvas.width - 58.0
    top, bottom = 0.16 * canvas.height, 0.84 * canvas.height
    edges = np.linspace(bottom, top, _STEPS + 1)
    middle = scale.low + (np.arange(_STEPS) + 0.5) / _STEPS * (scale.high - scale.low)
    for below, above, colour in zip(edges[:-1], edges[1:], scale.colours(middle), strict=True):
        corners = np.array([[left, below], [right, below], [right, above], [left, above]])
        canvas.area(corners, (colour[0], colour[1], colour[2]))
    for tick in ticks(scale.low, scale.high):
        y = bottom + (tick - scale.low) / (scale.high - scale.low) * (top - bottom)
        canvas.lines(np.array([[right, y], [right + 4, y]]), INK)
        canvas.words(f"{tick:.6g}", np.array([right + 7, y]), align="left")
    canvas.words(scale.label, np.array([canvas.width - 10.0, top - 18]), align="right")


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Three to `most` round numbers from low to high, 1, 2 or 5 times a power of ten apart."""
    raw = (high - low) / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= raw * (1 - 1e-9))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    # The step that gives at most six numbers can give one or two, which do not show a scale.
    if last - first + 1 < _FEWEST_TICKS:
        step /= 2
        first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(number * step) + 0.0 for number in np.arange(first, last + 1)]
