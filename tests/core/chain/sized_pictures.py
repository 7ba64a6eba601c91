"""Pictures and targets of any size, by OpenCV's camera model and its polygons with softened edges."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from grabberd.core.field import NumberedField, quantise, split_frame
from grabberd.core.geometry import NominalRig

BACKGROUND, WHITE = 20, 200
SHIFT = 6
"""Bits of a polygon's corners after the point: 1/64 of a pixel."""
FINER = 4
"""OpenCV draws a softened edge half a pixel too far out: in a finer picture, that is an eighth."""
SPREAD_PX = 0.7


class Picture(NamedTuple):
    """A camera with square pixels; the middle ray of either half meets the object's origin."""

    columns: int
    lines: int
    pixel_mm: float
    focal_mm: float = 8.0
    base_mm: float = 128.0
    distance_mm: float = 240.0

    @property
    def nominal(self) -> NominalRig:
        half = self.columns // 2
        halves = (0, half), (half, self.columns)
        convergence_deg = math.degrees(2 * math.atan(self.base_mm / 2 / self.distance_mm))
        size = self.base_mm, convergence_deg, self.focal_mm, self.pixel_mm, self.pixel_mm
        return NominalRig(self.columns, self.lines, *halves, self.distance_mm, *size)

    def project(self, places_mm: np.ndarray, side: int) -> np.ndarray:
        """(N, 2) columns and lines of places, as the left (-1) or the right (+1) half shows them."""
        middle = (self.columns - 1) / 2, (self.lines - 1) / 2
        aside = math.atan(side * self.columns / 4 * self.pixel_mm / self.focal_mm)
        turn = math.atan2(-side * self.base_mm / 2, self.distance_mm) - aside
        right = np.array([0.0, math.cos(turn), math.sin(turn)])
        forward = np.array([0.0, math.sin(turn), -math.cos(turn)])
        rotation = np.array([right, np.cross(forward, right), forward])
        seen = (places_mm - [0.0, side * self.base_mm / 2, self.distance_mm]) @ rotation.T
        focal = self.focal_mm / self.pixel_mm
        matrix = np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1.0]])
        return cv2.projectPoints(seen, np.zeros(3), np.zeros(3), matrix, np.zeros(5))[0][:, 0]

    def draw(self, places_mm: np.ndarray, diameter_mm: float) -> np.ndarray:
        """(lines, columns) uint8: white discs that face +Z, on black, as a lens shows them."""
        fine = np.full((FINER * self.lines, FINER * self.columns), BACKGROUND, np.uint8)
        angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        circle = diameter_mm / 2 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        for side in (-1, 1):
            for place in places_mm:
                corners = FINER * (self.project(place + circle, side) + 0.5) - 0.5
                fixed = np.rint(corners * (1 << SHIFT)).astype(np.int32)
                cv2.fillConvexPoly(fine, fixed, WHITE, cv2.LINE_AA, SHIFT)
        coarse = cv2.resize(fine, (self.columns, self.lines), interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(coarse, (0, 0), SPREAD_PX)


def fields(shown: np.ndarray, bits: int, count: int = 4, noise: float = 2.0) -> Iterator[NumberedField]:
    """The picture as fields of a grabber, with noise."""
    rng = np.random.default_rng(7)
    for number in range(count):
        grey = np.clip(np.rint(shown + rng.normal(0, noise, shown.shape)), 0, 255).astype(np.uint8)
        for parity, field in enumerate(split_frame(grey)):
            n = 2 * number + parity
            yield NumberedField(n, n * 20_000_000, n, quantise(field, bits, 70))
