"""Readings of a channel as two columns of bytes: their times, and their values bit for bit."""

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.groups.frames import differences, frame_of, planes_of, read_planes, sums
from grabberd.archive.capture.meta import LARGEST_TIME_NS

MOST_READINGS = 1 << 14
"""Readings of a group; half a second of 32 000 a second."""


def encode_times(time_ns: NDArray[np.int64]) -> bytes:
    """Encodes times as differences from the one before: of an even pace they are nearly alike."""
    return frame_of(planes_of(differences(time_ns.astype(np.uint64)[:, None])))


def decode_times(data: bytes, count: int) -> NDArray[np.int64]:
    """Decodes times.

    Raises:
        ValueError: There cannot be so many, the bytes are damaged, or the times do not ascend.
    """
    _check_count(count)
    folded = read_planes(data, "<u8", count).reshape(1, count).astype(np.uint64, copy=False)
    times = sums(folded).reshape(count).view(np.int64)
    if (np.diff(times) <= 0).any() or times[0] < 0 or times[-1] >= LARGEST_TIME_NS:
        raise ValueError("times of readings do not ascend, or no clock can have shown them")
    return times


def encode_values(value: NDArray[np.float64]) -> bytes:
    """Encodes values without a loss, in planes of bytes."""
    return frame_of(planes_of(np.ascontiguousarray(value, np.float64).view(np.uint64)))


def decode_values(data: bytes, count: int) -> NDArray[np.float64]:
    """Decodes values.

    Raises:
        ValueError: There cannot be so many, the bytes are damaged, or one is not a number.
    """
    _check_count(count)
    value = read_planes(data, "<u8", count).view("<f8").astype(np.float64, copy=False)
    if not np.isfinite(value).all():
        raise ValueError("a reading is not a number")
    return value


def _check_count(count: object) -> None:
    if not isinstance(count, int) or count not in range(1, MOST_READINGS + 1):
        raise ValueError(f"a group of {count!r} readings; there can be {MOST_READINGS}")
