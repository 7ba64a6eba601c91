"""Fields of discs at known places, drawn by OpenCV: no formula of the program's own is in them."""

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, Field

FINE = 8
"""Samples of a drawn disc for a pixel, in x and in y."""
BACKGROUND, CONTRAST = 30, 150
THRESHOLD = BACKGROUND + CONTRAST // 2
WHITE = 255
_COLUMNS, _LINES = 720, 576
_PITCH_PX = 26
_PATCH_PX = 16
_SPREAD_PX = 0.8


class DrawnDiscs(NamedTuple):
    """A field and what is in it.

    Attributes:
        field: The field.
        places_px: (N, 2) float64, true centres of the discs, frame pixels.
        noise: Standard deviation of a pixel, grey values.
    """

    field: Field
    places_px: NDArray[np.float64]
    noise: float


@lru_cache(maxsize=16)
def draw_discs(
    parity: int = TOP,
    *,
    seed: int = 1,
    diameters_px: tuple[float, float] = (5.0, 6.4),
    contrast: float = CONTRAST,
    noise: float = 3.0,
) -> DrawnDiscs:
    """Draw a grid of discs, each at a random place within its cell and of a random size.

    Args:
        parity: Lines of the field; `PROGRESSIVE` has all of them.
        seed: Of places, sizes and noise.
        diameters_px: Least and greatest diameter, frame pixels.
        contrast: Grey values of a disc's middle above the background, before it is cut off at white.
        noise: Standard deviation of a pixel, grey values.
    """
    rng = np.random.default_rng(seed)
    light = np.zeros((_LINES, _COLUMNS))
    places = []
    for top in range(_PITCH_PX, _LINES - 2 * _PITCH_PX, _PITCH_PX):
        for left in range(_PITCH_PX, _COLUMNS - 2 * _PITCH_PX, _PITCH_PX):
            centre = rng.integers(-FINE, FINE, 2, endpoint=True) + _PATCH_PX * FINE // 2
            light[top : top + _PATCH_PX, left : left + _PATCH_PX] += _disc(centre, rng.uniform(*diameters_px))
            # A pixel's middle lies between the two samples in the middle of its FINE.
            places.append((left, top) + (centre - (FINE - 1) / 2) / FINE)
    grey = BACKGROUND + contrast * light + rng.normal(0, noise, light.shape)
    luma = np.clip(np.rint(grey), 0, WHITE).astype(np.uint8)
    luma.setflags(write=False)  # whoever asks for the same again gets the same array
    return DrawnDiscs(field_of(luma, parity), np.array(places), noise)


def draw_nothing(parity: int = TOP, *, seed: int = 1, noise: float = 3.0) -> Field:
    """Draw the background alone."""
    grey = BACKGROUND + np.random.default_rng(seed).normal(0, noise, (_LINES, _COLUMNS))
    return field_of(np.clip(np.rint(grey), 0, WHITE).astype(np.uint8), parity)


def with_lamp(field: Field) -> Field:
    """The same field with something large and white at its left edge, which is no target."""
    luma = field.luma.copy()
    luma[10 : 10 + luma.shape[0] // 3, :12] = WHITE
    return Field(luma, field.parity, field.y0, field.y_step)


def field_of(luma: NDArray[np.uint8], parity: int) -> Field:
    """The lines of a picture that belong to a field."""
    if parity == PROGRESSIVE:
        return Field.progressive(luma)
    assert parity in (TOP, BOTTOM)
    return Field.intact(np.ascontiguousarray(luma[parity::2]), parity)


def _disc(centre: NDArray[np.int64], diameter_px: float) -> NDArray[np.float64]:
    """A disc of brightness 1 through the lens's spread and square pixels, at a fine sample (x, y)."""
    fine = np.zeros((_PATCH_PX * FINE, _PATCH_PX * FINE), np.float32)
    cv2.circle(fine, (int(centre[0]), int(centre[1])), round(diameter_px / 2 * FINE), 1.0, cv2.FILLED)
    spread = cv2.GaussianBlur(fine, (0, 0), _SPREAD_PX * FINE)
    return cv2.resize(spread, (_PATCH_PX, _PATCH_PX), interpolation=cv2.INTER_AREA).astype(np.float64)
