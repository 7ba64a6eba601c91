"""Antialiased lines, areas and text on a picture, drawn at twice the size and then reduced."""

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float]
"""Blue, green, red, 0 to 255."""

PAPER: Colour = (255, 255, 255)
INK: Colour = (60, 50, 45)

# Hard edges at twice the size, in 1/16 pixel, then averaged: neighbouring facets meet without a seam.
_LARGER = 2
_SHIFT = 4
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_PX = 22.0
"""Height of the font's capitals at scale 1, in pixels."""


class Canvas:
    """A picture being drawn; positions are (x, y) in its pixels, y down."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._picture = np.full((height * _LARGER, width * _LARGER, 3), PAPER, np.uint8)

    def area(self, corners: Array, colour: Colour) -> None:
        """Fills a convex polygon, (K, 2) corners."""
        cv2.fillConvexPoly(self._picture, _fixed(corners), colour, cv2.LINE_8, _SHIFT)

    def lines(self, corners: Array, colour: Colour, width: int = 1) -> None:
        """Draws a polyline through (K, 2) positions."""
        cv2.polylines(
            self._picture, [_fixed(corners)], isClosed=False, color=colour, thickness=width * _LARGER,
            lineType=cv2.LINE_8, shift=_SHIFT,
        )  # fmt: skip

    def words(
        self,
        text: str,
        place: Array,
        colour: Colour = INK,
        size_px: float = 9.0,
        align: Literal["left", "middle", "right"] = "middle",
    ) -> None:
        """Writes text, vertically centred on a position; ASCII only, as OpenCV's fonts have no more."""
        scale = size_px * _LARGER / _FONT_PX
        (width, height), _ = cv2.getTextSize(text, _FONT, scale, _LARGER - 1)
        share = {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
        corner = (round(place[0] * _LARGER - share * width), round(place[1] * _LARGER + height / 2))
        cv2.putText(self._picture, text, corner, _FONT, scale, colour, _LARGER - 1, cv2.LINE_AA)

    def picture(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8, blue, green, red."""
        size = (self.width, self.height)
        return np.asarray(cv2.resize(self._picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _fixed(corners: Array) -> NDArray[np.int32]:
    """Fixed-point coordinates of the enlarged drawing, whose pixel centres are at whole numbers."""
    enlarged = (corners + 0.5) * _LARGER - 0.5
    return np.round(enlarged * (1 << _SHIFT)).astype(np.int32)
