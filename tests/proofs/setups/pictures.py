"""Pictures of calibration frames by OpenCV's camera model, and what goes wrong with them."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from core.chain.pinhole_pictures import HALF, frames, still
from core.shipped_models import PAPER, shipped_model
from grabberd.core.calibration.calibration_frame import targets_to_add
from grabberd.core.calibration.identification.frame_identification import IdentificationSettings
from grabberd.core.field import Field, NumberedField, double_lines, quantise, split_frame
from grabberd.core.reconstruction import ObjectModel

COUNT = 12
THRESHOLD = 50
PLACES_SEED = 3
FRAMES = ("irregular", "marked", "regular")
"""Frames by what tells how they stand: the depths, one further target, or a person."""

Picture = np.ndarray
Change = Callable[[Picture], Picture]


@cache
def model(frame: str = "irregular") -> ObjectModel:
    """The calibration frame's file, as it is right."""
    shipped = shipped_model(PAPER)
    if frame == "irregular":
        return shipped
    regular = replace(shipped, xyz_mm=np.column_stack([shipped.xyz_mm[:, :2], _regular_depths(shipped)]))
    if frame == "regular":
        return regular
    (place,) = targets_to_add(regular, IdentificationSettings().margin)
    return regular.with_target(place)


def _regular_depths(frame: ObjectModel) -> np.ndarray:
    """Depths that a turn by 180 degrees and both mirrors leave as they are."""
    inward = np.minimum(frame.row, 11 - frame.row) + np.abs(frame.column - 4)
    return 4.0 * (inward % 3) - 4.0


def made(frame: ObjectModel) -> np.ndarray:
    """(N, 3) places of the targets as they were made: off the file by their σ."""
    return frame.xyz_mm + np.random.default_rng(PLACES_SEED).normal(0, frame.sigma_mm, frame.xyz_mm.shape)


@cache
def picture(frame: str = "irregular", spread_px: float = 0.75, one_mirror: bool = False) -> Picture:
    """The whole picture of a frame that its file describes."""
    return picture_of(made(model(frame)), spread_px, one_mirror)


def picture_of(xyz_mm: np.ndarray, spread_px: float = 0.75, one_mirror: bool = False) -> Picture:
    """The whole picture of targets at these places."""
    return still(xyz_mm, model().target_diameter_mm, one_mirror, spread_px)


def halves(shown: Picture) -> tuple[Picture, Picture]:
    return shown[:, :HALF], shown[:, HALF:]


def mirrored(shown: Picture, left: bool = True, right: bool = True) -> Picture:
    """Each half flipped in place."""
    first, second = halves(shown)
    return np.hstack([first[:, ::-1] if left else first, second[:, ::-1] if right else second])


def swapped(shown: Picture) -> Picture:
    return np.hstack(halves(shown)[::-1])


def dimmed(shown: Picture, share: float) -> Picture:
    first, second = halves(shown)
    return np.hstack([first, share * second])


def covered(shown: Picture, first: int, end: int | None = None) -> Picture:
    """The lines from the first one to the end alone."""
    seen = np.zeros_like(shown)
    seen[first:end] = shown[first:end]
    return seen


def fields(shown: Picture, bits: int = 8, count: int = COUNT, seed: int = 0) -> Iterator[NumberedField]:
    """The picture as fields of a grabber, with noise and line jitter; at 1 bit with doubled lines."""
    for number, grey in enumerate(frames(shown, count, np.random.default_rng(seed))):
        yield from _split(grey, number, bits)


def moving(shown: Picture, drift_px: float, bits: int = 8) -> Iterator[NumberedField]:
    """The same while the stand sinks by so much in all."""
    rng = np.random.default_rng(1)
    for number in range(COUNT):
        down = drift_px * (number / (COUNT - 1) - 0.5)
        sunk = cv2.warpAffine(shown, np.array([[1, 0, 0], [0, 1, down]]), shown.shape[::-1])
        yield from _split(next(iter(frames(sunk, 1, rng))), number, bits)


def creeping(frame: str, axis: int, by_mm: float, bits: int = 8) -> Iterator[NumberedField]:
    """The same while the frame creeps along an axis: far less than a pixel, so that pictures can be mixed."""
    rng, step = np.random.default_rng(2), np.zeros(3)
    step[axis] = by_mm
    first, last = (picture_of(made(model(frame)) + share * step) for share in (-0.5, 0.5))
    for number in range(COUNT):
        share = number / (COUNT - 1)
        mixed = (1 - share) * first + share * last
        yield from _split(next(iter(frames(mixed, 1, rng))), number, bits)


def _split(grey: Picture, number: int, bits: int) -> Iterator[NumberedField]:
    for parity, field in enumerate(split_frame(grey)):
        assert isinstance(field, Field)
        n = 2 * number + parity
        taken = double_lines(field) if bits == 1 else field
        yield NumberedField(n, n * 20_000_000, n, quantise(taken, bits, THRESHOLD))
