"""Pictures of the calibration frame by OpenCV's camera model, and what goes wrong with them."""

from collections.abc import Iterator
from functools import cache

import cv2
import numpy as np
import yaml

from core.chain.pinhole_pictures import HALF, frames, still
from grabberd.config import shipped_configs
from grabberd.core.field import Field, NumberedField, quantise, split_frame
from grabberd.core.reconstruction import ObjectModel

COUNT = 12
THRESHOLD = 50
PLACES_SEED = 3


@cache
def frame() -> ObjectModel:
    """The calibration frame's file, as it is right."""
    path = shipped_configs() / "calibration-frames" / "paper-108.yaml"
    return ObjectModel.from_document(yaml.safe_load(path.read_text("utf-8")))


@cache
def picture(spread_px: float = 0.75, one_mirror: bool = False) -> np.ndarray:
    """The whole picture of the frame as it was made, its targets off by their σ."""
    return picture_of(frame().xyz_mm, spread_px, one_mirror)


def picture_of(xyz_mm: np.ndarray, spread_px: float = 0.75, one_mirror: bool = False) -> np.ndarray:
    """The same of a frame with other places."""
    made = xyz_mm + np.random.default_rng(PLACES_SEED).normal(0, frame().sigma_mm, xyz_mm.shape)
    return still(made, frame().target_diameter_mm, one_mirror, spread_px)


def halves(shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return shown[:, :HALF], shown[:, HALF:]


def mirrored(shown: np.ndarray, left: bool = True, right: bool = True) -> np.ndarray:
    """Each half flipped in place."""
    first, second = halves(shown)
    return np.hstack([first[:, ::-1] if left else first, second[:, ::-1] if right else second])


def swapped(shown: np.ndarray) -> np.ndarray:
    return np.hstack(halves(shown)[::-1])


def dimmed(shown: np.ndarray, share: float) -> np.ndarray:
    first, second = halves(shown)
    return np.hstack([first, share * second])


def covered(shown: np.ndarray, first: int, end: int | None = None) -> np.ndarray:
    """The lines from the first one to the end alone."""
    seen = np.zeros_like(shown)
    seen[first:end] = shown[first:end]
    return seen


def fields(shown: np.ndarray, count: int = COUNT, seed: int = 0) -> Iterator[NumberedField]:
    """The picture as fields of a grabber, with noise and line jitter."""
    for number, grey in enumerate(frames(shown, count, np.random.default_rng(seed))):
        yield from _split(grey, number)


def moving(shown: np.ndarray, drift_px: float) -> Iterator[NumberedField]:
    """The same while the stand sinks by so much in all."""
    rng = np.random.default_rng(1)
    for number in range(COUNT):
        down = drift_px * (number / (COUNT - 1) - 0.5)
        sunk = cv2.warpAffine(shown, np.array([[1, 0, 0], [0, 1, down]]), shown.shape[::-1])
        yield from _split(next(iter(frames(sunk, 1, rng))), number)


def _split(grey: np.ndarray, number: int) -> Iterator[NumberedField]:
    for parity, field in enumerate(split_frame(grey)):
        assert isinstance(field, Field)
        n = 2 * number + parity
        yield NumberedField(n, n * 20_000_000, n, quantise(field, 8, THRESHOLD))
