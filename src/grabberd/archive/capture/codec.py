"""Encodings in a capture file: single fields and points of format 1, and zstandard frames of integers.

The integers of a frame are stored in planes of bytes, all lowest bytes first, which compress well.
"""

import math
import zlib
from collections.abc import Iterable

import numpy as np
import zstandard
from numpy.typing import NDArray

from grabberd.core.field import packed_shape
from grabberd.core.reconstruction.points import Points

ZLIB = "zlib"
ZSTD = "zstd"
MOST_POINTS = 1 << 16
"""Maximum number of points of one field; object models have some hundred targets."""

POINT = np.dtype(
    [
        ("target", "<i4"),
        ("xyz_mm", "<f8", 3),
        ("covariance_mm2", "<f4", 6),
        ("calibration_covariance_mm2", "<f4", 6),
        ("image_px", "<f4", (2, 2)),
        ("residual_px", "<f4"),
    ]
)
"""One point in `points.data`, little-endian, packed; covariances as xx, xy, xz, yy, yz, zz.

Positions are exact; single precision keeps seven digits of the rest, which is more than its accuracy.
"""
UPPER = np.triu_indices(3)
"""Indices of a covariance's six elements: xx, xy, xz, yy, yz, zz."""


def decode_field(codec: str, data: bytes, rows: int, columns: int, bits: int) -> NDArray[np.uint8]:
    """Decodes the bytes of a picture into `PackedField.data`.

    Raises:
        ValueError: The codec is unknown, or the bytes are damaged or belong to a picture of another size.
    """
    shape = packed_shape(rows, columns, bits)
    size = math.prod(shape)
    if codec == ZLIB:
        return np.frombuffer(_inflated(data, size), np.uint8).reshape(shape)
    if codec == ZSTD:
        return np.frombuffer(unpacked(data, size), np.uint8).reshape(shape)
    raise ValueError(f"codec {codec!r} is none of {ZLIB}, {ZSTD}")


def _inflated(data: bytes, size: int) -> bytes:
    """Decompresses to exactly `size` bytes; never produces more than one byte beyond that."""
    stream = zlib.decompressobj()
    try:
        # A limit of 0 would mean no limit.
        content = stream.decompress(data, size + 1)
    except zlib.error as error:
        raise ValueError(f"damaged {ZLIB} data: {error}") from error
    _check_size(ZLIB, size, len(content))
    if not stream.eof or stream.unused_data:
        raise ValueError(f"damaged {ZLIB} data: {'other bytes follow' if stream.eof else 'they have no end'}")
    return content


def unpacked(data: bytes, size: int) -> bytes:
    """Decompresses a zstandard frame to exactly `size` bytes.

    Raises:
        ValueError: Its stated or actual size differs, it is damaged, or other data follow it.
    """
    try:
        claimed = zstandard.frame_content_size(data)
        if claimed >= 0:
            _check_size(ZSTD, size, claimed)
        content = zstandard.ZstdDecompressor().decompress(data, max_output_size=size, allow_extra_data=False)
    except zstandard.ZstdError as error:
        raise ValueError(f"damaged {ZSTD} data: {error}") from error
    _check_size(ZSTD, size, len(content))
    return content


def _check_size(codec: str, expected: int, found: int) -> None:
    if found != expected:
        more = "more" if found > expected else "fewer"
        raise ValueError(f"damaged {codec} data: {more} bytes than the {expected} expected")


def encode_points(points: Points) -> bytes:
    """Encodes one field's points as compressed `POINT` records."""
    records = np.zeros(len(points), POINT)
    records["target"] = points.target
    records["xyz_mm"] = points.xyz_mm
    records["covariance_mm2"] = points.covariance_mm2[:, *UPPER]
    records["calibration_covariance_mm2"] = points.calibration_covariance_mm2[:, *UPPER]
    records["image_px"] = points.image_px
    records["residual_px"] = points.residual_px
    return zlib.compress(records.tobytes(), 1)


def decode_points(data: bytes, count: int) -> Points:
    """Decodes one field's points; positions are exact, the rest has single precision.

    Args:
        data: Bytes of `encode_points`.
        count: Number of points expected.

    Raises:
        ValueError: The count is out of range, or the bytes are damaged or contain a different number.
    """
    if count not in range(MOST_POINTS + 1):
        raise ValueError(f"a field of {count!r} points; there can be {MOST_POINTS}")
    try:
        records = np.frombuffer(_inflated(data, count * POINT.itemsize), POINT)
    except ValueError as error:
        raise ValueError(f"damaged points: {error}") from error
    return Points(
        target=records["target"].copy(),
        xyz_mm=records["xyz_mm"].copy(),
        covariance_mm2=symmetric(records["covariance_mm2"]),
        calibration_covariance_mm2=symmetric(records["calibration_covariance_mm2"]),
        image_px=records["image_px"].astype(np.float64),
        residual_px=records["residual_px"].astype(np.float64),
    )


def symmetric(elements: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 3, 3) symmetric matrices from their (N, 6) elements."""
    full = np.empty((len(elements), 3, 3))
    full[:, *UPPER] = elements
    full[:, UPPER[1], UPPER[0]] = elements
    return full


LEVEL = 1
"""Compression level: fields are compressed live by the writer's thread; level 3 would save 1 %."""


def frame_of(parts: Iterable[bytes]) -> bytes:
    """One frame of several parts that states its size; each part is a block with its own statistics."""
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
    """The `count` values in a frame of `planes_of`.

    Raises:
        ValueError: The frame is damaged, or has a different size.
    """
    size = np.dtype(dtype).itemsize
    planes = np.frombuffer(unpacked(data, size * count), np.uint8).reshape(size, count)
    return np.ascontiguousarray(planes.T).reshape(-1).view(dtype)


def differences(values: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """(N, k) values as (k, N) differences from the row above, modulo their size, with the sign folded in.

    0, −1, 1, −2 … become 0, 1, 2, 3 …, so that the upper bytes of small differences are 0.
    """
    steps = values.T.copy()
    steps[:, 1:] -= values.T[:, :-1]
    signed = steps.view(f"i{steps.itemsize}")
    return ((signed << 1) ^ (signed >> (8 * steps.itemsize - 1))).view(steps.dtype)


def sums(folded: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """The (N, k) values from their (k, N) `differences`."""
    one = folded.dtype.type(1)
    steps = (folded >> one) ^ (~(folded & one) + one)
    return np.cumsum(steps, axis=1, dtype=folded.dtype).T
