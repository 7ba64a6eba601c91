"""Footage of a moving object in two views, drawn by OpenCV's polygons: no code of the project is in it."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

FINER = 8
"""Steps of a pixel that polygons are drawn in."""


def moment(
    time: float,
    columns: int,
    lines: int,
    *,
    split: int,
    diameter_px: float,
    pitch_px: float,
) -> NDArray[np.uint8]:
    """What a camera sees at a time, in field steps: a grid of discs in each view, which swings a little."""
    swing = 0.6 * diameter_px * np.array([np.sin(0.13 * time), np.cos(0.17 * time)])
    fine = np.zeros((lines * FINER, columns * FINER), np.uint8)
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    edge = diameter_px / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for first, end, sign in ((0, split, 1), (split, columns, -1)):
        width = 0.62 * (end - first)
        x = (first + end) / 2 + np.arange(-width / 2, width / 2, pitch_px)
        y = np.arange(0.15 * lines, 0.85 * lines, pitch_px)
        for at in np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2):
            corners = ((at + swing * (sign, 1) + edge + 0.5) * FINER - 0.5) * 16
            cv2.fillPoly(fine, [np.round(corners).astype(np.int32)], 255, shift=4)
    light = cv2.resize(fine, (columns, lines), interpolation=cv2.INTER_AREA).astype(np.float32)
    light = 25 + cv2.GaussianBlur(light, (0, 0), 0.7) / 255 * 150
    light += np.random.default_rng(round(1000 * time)).normal(0, 3, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def footage(kind: str, count: int, columns: int, lines: int, **scene: float) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a kind: "progressive"; "top_first" or "bottom_first", which show two moments each."""
    for number in range(count):
        if kind == "progressive":
            yield moment(2.0 * number, columns, lines, **scene)
            continue
        frame = np.empty((lines, columns), np.uint8)
        older = 0 if kind == "top_first" else 1
        frame[older::2] = moment(2.0 * number, columns, lines, **scene)[older::2]
        frame[1 - older :: 2] = moment(2.0 * number + 1, columns, lines, **scene)[1 - older :: 2]
        yield frame
