"""Frames of a few discs at given places, drawn by OpenCV: no code of the project is in it."""

import cv2
import numpy as np
from numpy.typing import NDArray

LINES, COLUMNS = 192, 256
_FINER = 16


def frame(move: tuple[float, float], random: np.random.Generator, noise: float = 2.0) -> NDArray[np.uint8]:
    """(192, 256) uint8: discs of 6 pixels, moved by (x, y) pixels from places that are nearly a grid."""
    picture = np.full((LINES, COLUMNS), 20, np.uint8)
    for row in range(4):
        for column in range(6):
            x = 30.3 + 38 * column + 3 * np.sin(5 * row + column) + move[0]
            y = 28.6 + 42 * row + 3 * np.sin(3 * column + row) + move[1]
            centre = (round(x * _FINER), round(y * _FINER))
            cv2.circle(picture, centre, 3 * _FINER, 200, -1, cv2.LINE_AA, 4)
    blurred = cv2.GaussianBlur(picture, (0, 0), 0.8)
    return np.clip(np.rint(blurred + random.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)
