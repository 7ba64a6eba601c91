"""Rendered pictures and animations as files, which are decoded and compared with what was drawn."""

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.archive.export.read_back import png_check
from grabberd.errors import InputError, StorageError
from grabberd.files.checked_file import Check, checked_path, write_checked
from grabberd.files.disk import new_folder, storage_errors

Picture = NDArray[np.uint8]

FORMATS = ("webm", "gif")
MOST_PER_S = {"webm": 240.0, "gif": 50.0}
"""Pictures per second of an animation, by its format."""

_VP9 = cv2.VideoWriter.fourcc(*"VP90")
# GIF counts in hundredths of a second; browsers show a picture of fewer than two as long as one of ten.
_GIF_STEP_S = 0.01
_GIF_QUICKEST_S = 0.02
# All pictures of a GIF are in memory at once; those of a WebM are encoded one by one.
_MOST_GIF_PICTURES = 500
_THUMBNAIL_PX = 8
_ALIKE = 24.0
"""Greatest difference of two thumbnails in grey values; VP9 and 256 colours change about half of it."""


def write_pictures(directory: Path, pictures: Mapping[str, Picture]) -> list[Path]:
    """Writes NAME.png for every picture, grey or with three or four channels, into a new folder.

    Raises:
        StorageError: See `new_folder`.
    """
    new_folder(directory)
    paths = []
    for name, picture in pictures.items():
        path = directory / f"{name}.png"
        paths.append(write_checked(path, [bytes(cv2.imencode(".png", picture)[1])], png_check(picture)))
    return paths


def write_animation(directory: Path, name: str, pictures: Iterable[Picture], per_s: float) -> Path:
    """Writes an animation into a new folder: WebM (VP9) or GIF, by the ending of its name.

    Args:
        directory: New or empty folder.
        name: NAME.webm or NAME.gif.
        pictures: (height, width, 3) uint8, all of the same even size.
        per_s: Pictures per second, at most those of `MOST_PER_S`.

    Raises:
        InputError: There are no pictures, or too many for a GIF.
        StorageError: It cannot be written, or does not read back as it was drawn.
    """
    new_folder(directory)
    path, drawn = directory / name, Drawn()
    write = _write_gif if path.suffix == ".gif" else _write_webm
    with checked_path(path, _quiet(drawn.check)) as part:
        write(part, name, drawn.noted(pictures), per_s)
    return path


def _write_webm(path: Path, name: str, pictures: Iterable[Picture], per_s: float) -> None:
    writer: cv2.VideoWriter | None = None
    try:
        for picture in pictures:
            writer = writer or _opened(path, name, picture.shape[1], picture.shape[0], per_s)
            writer.write(picture)
    finally:
        if writer is not None:
            writer.release()
    if writer is None:
        raise _nothing(name)
    if not path.is_file() or path.stat().st_size == 0:
        raise StorageError(f"{name} could not be written", "make room on the disk, or choose another folder")


def _opened(path: Path, name: str, width: int, height: int, per_s: float) -> cv2.VideoWriter:
    with _without_chatter():
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, _VP9, per_s, (width, height))
    if not writer.isOpened():
        raise StorageError(
            f"{name} cannot be written as WebM (VP9)",
            "this computer's OpenCV may lack VP9: choose --format gif",
        )
    return writer


@contextmanager
def _without_chatter() -> Iterator[None]:
    """Discards what FFmpeg says: that VP9 has no tag of its own in WebM, or what it thinks of a damaged file.

    FFmpeg writes it to the process's standard error, so Python's `sys.stderr` cannot catch it.
    """
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _quiet(check: Check) -> Check:
    """The same check without FFmpeg's own words."""

    def checked(path: Path) -> str | None:
        with _without_chatter():
            return check(path)

    return checked


def _write_gif(path: Path, name: str, pictures: Iterable[Picture], per_s: float) -> None:
    """Writes a GIF, which shows each picture for whole hundredths of a second, at least two of them."""
    animation = cv2.Animation()
    kept = []
    for picture in pictures:
        kept.append(picture)
        if len(kept) > _MOST_GIF_PICTURES:
            raise InputError(
                f"a GIF can have at most {_MOST_GIF_PICTURES} pictures",
                "choose fewer fields, --every 2, or WebM",
            )
    if not kept:
        raise _nothing(name)
    shown_s = max(round(1 / per_s / _GIF_STEP_S) * _GIF_STEP_S, _GIF_QUICKEST_S)
    animation.frames = kept
    animation.durations = [round(shown_s * 1000)] * len(kept)
    good, data = cv2.imencodeanimation(".gif", animation)
    if not good:
        raise StorageError(f"{name} cannot be encoded as GIF", "choose WebM")
    with storage_errors(path):
        path.write_bytes(bytes(data))


def _nothing(name: str) -> InputError:
    return InputError(f"{name}: there are no pictures to write", "choose fields that the capture has")


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
