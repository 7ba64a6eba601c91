"""Zstandard frames of whole numbers, in planes of bytes that compress well apart."""

from collections.abc import Iterable

import numpy as np
import zstandard
from numpy.typing import NDArray

from grabberd.archive.capture.codec import unpacked

LEVEL = 1
"""Fields are compressed as fast as they arrive, on the thread that writes the capture; level 3 saves 1 %."""


def frame_of(parts: Iterable[bytes]) -> bytes:
    """One frame of several parts, which says its size; each part is a block with statistics of its own."""
    content = list(parts)
    compressor = zstandard.ZstdCompressor(level=LEVEL).compressobj(size=sum(map(len, content)))
    blocks = [
        block
        for part in content
        for block in (compressor.compress(part), compressor.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK))
    ]
    return b"".join([*blocks, compressor.flush()])


def planes_of(values: NDArray[np.unsignedinteger]) -> list[bytes]:
    """The lowest bytes of all values, then the next ones, up to the highest."""
    little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    return [plane.tobytes() for plane in little.reshape(-1).view(np.uint8).reshape(-1, values.itemsize).T]


def read_planes(data: bytes, dtype: str, count: int) -> NDArray[np.unsignedinteger]:
    """The `count` values of a frame of `planes_of`.

    Raises:
        ValueError: The frame is damaged, or holds anything else.
    """
    size = np.dtype(dtype).itemsize
    planes = np.frombuffer(unpacked(data, size * count), np.uint8).reshape(size, count)
    values: NDArray[np.unsignedinteger] = np.ascontiguousarray(planes.T).reshape(-1).view(dtype)
    return values


def differences(values: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """(N, k) values as (k, N) differences from the row above, modulo their size, with the sign folded in.

    0, −1, 1, −2 … become 0, 1, 2, 3 …, so that the upper bytes of small differences are 0.
    """
    steps = values.T.copy()
    steps[:, 1:] -= values.T[:, :-1]
    signed = steps.view(f"i{steps.itemsize}")
    folded: NDArray[np.unsignedinteger] = ((signed << 1) ^ (signed >> (8 * steps.itemsize - 1))).view(
        steps.dtype
    )
    return folded


def sums(folded: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """The (N, k) values of their (k, N) `differences`."""
    one = folded.dtype.type(1)
    steps = (folded >> one) ^ (~(folded & one) + one)
    values: NDArray[np.unsignedinteger] = np.cumsum(steps, axis=1, dtype=folded.dtype).T
    return values
