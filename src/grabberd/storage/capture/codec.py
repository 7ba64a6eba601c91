"""Encoding and decoding of fields and points in a capture file."""

import zlib

import numpy as np
import zstandard
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.field.field import packed_shape
from grabberd.reconstruction.points import Points

ZLIB = "zlib"
ZSTD = "zstd"

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
_UPPER = np.triu_indices(3)


def encode_field(packed: PackedField) -> tuple[str, bytes]:
    """Codec and bytes of a picture: zlib for one bit, zstandard for more.

    Both at level 1: fields are encoded as fast as they arrive, on the thread that writes the capture.
    """
    raw = packed.data.tobytes()
    # A capture has to be readable with anything, and every language reads zlib: one bit is the default.
    if packed.bits == 1:
        return ZLIB, zlib.compress(raw, 1)
    return ZSTD, zstandard.ZstdCompressor(level=1).compress(raw)


def decode_field(codec: str, data: bytes, rows: int, columns: int, bits: int) -> NDArray[np.uint8]:
    """Decodes the bytes of a picture into `PackedField.data`.

    Raises:
        ValueError: The codec is unknown, or the bytes are damaged.
    """
    shape = packed_shape(rows, columns, bits)
    return np.frombuffer(_decompress(codec, data, int(np.prod(shape))), np.uint8).reshape(shape)


def _decompress(codec: str, data: bytes, size: int) -> bytes:
    try:
        if codec == ZLIB:
            return zlib.decompress(data)
        if codec == ZSTD:
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except (zlib.error, zstandard.ZstdError) as error:
        raise ValueError(f"damaged {codec} data: {error}") from error
    raise ValueError(f"codec {codec!r} is none of {ZLIB}, {ZSTD}")


def encode_points(points: Points) -> bytes:
    """Encodes one field's points as compressed `POINT` records."""
    records = np.zeros(len(points), POINT)
    records["target"] = points.target
    records["xyz_mm"] = points.xyz_mm
    records["covariance_mm2"] = points.covariance_mm2[:, *_UPPER]
    records["calibration_covariance_mm2"] = points.calibration_covariance_mm2[:, *_UPPER]
    records["image_px"] = points.image_px
    records["residual_px"] = points.residual_px
    return zlib.compress(records.tobytes(), 1)


def decode_points(data: bytes) -> Points:
    """Decodes one field's points; positions are exact, the rest has single precision.

    Raises:
        ValueError: The bytes are damaged.
    """
    try:
        records = np.frombuffer(zlib.decompress(data), POINT)
    except zlib.error as error:
        raise ValueError(f"damaged points: {error}") from error
    return Points(
        target=records["target"].copy(),
        xyz_mm=records["xyz_mm"].copy(),
        covariance_mm2=_symmetric(records["covariance_mm2"]),
        calibration_covariance_mm2=_symmetric(records["calibration_covariance_mm2"]),
        image_px=records["image_px"].astype(np.float64),
        residual_px=records["residual_px"].astype(np.float64),
    )


def _symmetric(upper: NDArray[np.floating]) -> NDArray[np.float64]:
    full = np.empty((len(upper), 3, 3))
    full[:, *_UPPER] = upper
    full[:, _UPPER[1], _UPPER[0]] = upper
    return full
