"""A check of written animations: decoded, they show as many pictures as were drawn, and the same ones."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]

_THUMBNAIL_PX = 8
_ALIKE = 24.0
"""Greatest difference of two thumbnails in grey values; VP9 and 256 colours change about half of it."""


class Drawn:
    """Record of what an animation has to show: a thumbnail of each picture, noted as it is drawn."""

    def __init__(self) -> None:
        self._thumbnails: list[Picture] = []
        self._shape: tuple[int, ...] = ()

    def noted(self, pictures: Iterable[Picture]) -> Iterator[Picture]:
        """Passes pictures on."""
        for picture in pictures:
            self._shape = picture.shape[:2]
            self._thumbnails.append(_thumbnail(picture))
            yield picture

    def check(self, path: Path) -> str | None:
        """Decodes WebM or GIF; returns what is wrong with it in words, or None."""
        shown = 0
        for picture in _shown(path):
            if shown == len(self._thumbnails):
                return f"it has more than {shown} pictures"
            if picture.shape[:2] != self._shape:
                return f"picture {shown + 1} has {picture.shape[1]} × {picture.shape[0]} pixels"
            off = np.abs(_thumbnail(picture).astype(np.float64) - self._thumbnails[shown]).max()
            if off > _ALIKE:
                return f"picture {shown + 1} is another one"
            shown += 1
        expected = len(self._thumbnails)
        return None if shown == expected else f"it has {shown} pictures, expected {expected}"


def _shown(path: Path) -> Iterator[Picture]:
    if path.suffix == ".gif":
        good, animation = cv2.imreadanimation(str(path))
        for picture in animation.frames if good else ():
            yield np.asarray(picture[:, :, :3], np.uint8)
        return
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        while (read := video.read())[0]:
            yield np.asarray(read[1], np.uint8)
    finally:
        video.release()


def _thumbnail(picture: Picture) -> Picture:
    return np.asarray(
        cv2.resize(picture, (_THUMBNAIL_PX, _THUMBNAIL_PX), interpolation=cv2.INTER_AREA), np.uint8
    )
