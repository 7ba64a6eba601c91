"""Encodings in a capture file: single fields and points of format 1, columns of points of format 2.

Positions are multiples of 10⁻⁴ mm, 1/500 of the σ of one field; image coordinates and residuals of 10⁻³ px,
1/100 of their σ. Covariances are stored as Cholesky factors in half precision, accurate to 10⁻³ of the
product of the two σ; the result is symmetric without negative variances, however thin the ellipsoid is. A
number that does not fit is stored exactly. Each number is rounded independently, so a point does not depend
on the others stored with it. Columns are sorted by target, then by field, and contain differences from the
previous point, which are small within a target.

The integers of a zstandard frame are stored in planes of bytes, all lowest bytes first, which compress well.
"""

import math
import zlib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

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


def encode_field_points(points: Points) -> bytes:
    """Encodes one field's points as compressed `POINT` records."""
    records = np.zeros(len(points), POINT)
    records["target"] = points.target
    records["xyz_mm"] = points.xyz_mm
    records["covariance_mm2"] = points.covariance_mm2[:, *UPPER]
    records["calibration_covariance_mm2"] = points.calibration_covariance_mm2[:, *UPPER]
    records["image_px"] = points.image_px
    records["residual_px"] = points.residual_px
    return zlib.compress(records.tobytes(), 1)


def decode_field_points(data: bytes, count: int) -> Points:
    """Decodes one field's points; positions are exact, the rest has single precision.

    Args:
        data: Bytes of `encode_field_points`.
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


PER_MM = 10_000
PER_PX = 1_000
LARGEST_WHOLE = 2**31 - 1
LARGEST_CHANGE = 1e-3
"""Largest rounding error of a covariance, relative to the σ of its row and column."""


def quantised(points: Points) -> Points:
    """Points as read back from a file; quantising them again changes nothing."""
    return Points(
        target=points.target,
        xyz_mm=rounded(points.xyz_mm, PER_MM),
        covariance_mm2=symmetric(rounded_covariance(points.covariance_mm2)),
        calibration_covariance_mm2=symmetric(rounded_covariance(points.calibration_covariance_mm2)),
        image_px=rounded(points.image_px, PER_PX),
        residual_px=rounded(points.residual_px, PER_PX),
    )


def whole(values: NDArray[np.float64], per_unit: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values as multiples of a quantum, and a mask of the finite ones that fit into 32 bits."""
    with np.errstate(invalid="ignore", over="ignore"):
        quanta = np.rint(values * per_unit) + 0.0  # without negative zeros, which integers lack
        return quanta, np.abs(quanta) <= LARGEST_WHOLE


def rounded(values: NDArray[np.float64], per_unit: int) -> NDArray[np.float64]:
    """Values rounded to multiples of a quantum; those that do not fit are unchanged."""
    quanta, fits = whole(values, per_unit)
    return np.where(fits, quanta / per_unit, values)


def factors(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float16], NDArray[np.bool_]]:
    """(N, 6) elements of the Cholesky factors of (N, 3, 3) covariances, and a mask of the accurate ones.

    The elements are the columns of the lower factor: xx, xy, xz, yy, yz, zz.
    """
    xx, xy, xz, yy, yz, zz = elements = covariance[:, *UPPER].T
    with np.errstate(all="ignore"):
        a = np.sqrt(xx)
        b, c = _quotient(xy, a), _quotient(xz, a)
        d = np.sqrt(np.maximum(yy - b * b, 0.0))
        e = _quotient(yz - b * c, d)
        f = np.sqrt(np.maximum(zz - c * c - e * e, 0.0))
        half = np.stack((a, b, c, d, e, f), axis=1).astype(np.float16)
        deviation = np.sqrt([xx, yy, zz])
        allowed = LARGEST_CHANGE * deviation[UPPER[0]] * deviation[UPPER[1]]
        near = np.abs(product(half).T - elements) <= allowed
    return half, np.logical_and.reduce(near)


def _quotient(value: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """The quotient, 0 for 0 / 0: a variance of 0 has no covariances."""
    return np.where(by > 0, value / by, 0.0)


def product(half: NDArray[np.float16]) -> NDArray[np.float64]:
    """(N, 6) elements xx, xy, xz, yy, yz, zz of the covariances of (N, 6) factors."""
    a, b, c, d, e, f = half.astype(np.float64).T
    with np.errstate(invalid="ignore"):  # factors beyond half precision's range, or in a damaged file
        return np.stack((a * a, a * b, a * c, b * b + d * d, b * c + d * e, c * c + e * e + f * f), axis=1)


def rounded_covariance(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 6) elements of (N, 3, 3) covariances from rounded factors; inaccurate ones are unchanged."""
    half, near = factors(covariance)
    return np.where(near[:, None], product(half), covariance[:, *UPPER])


WHOLE = (("xyz_mm", PER_MM, 3), ("image_px", PER_PX, 4), ("residual_px", PER_PX, 1))
"""Quantised columns: name, quanta per unit, numbers per point."""
COVARIANCES = ("covariance_mm2", "calibration_covariance_mm2")
_ELEMENTS = 6
COLUMNS = ("target", "xyz_mm", *COVARIANCES, "image_px", "residual_px")
"""Columns in the order of the table."""


class PointColumns(NamedTuple):
    """The points of a group.

    Attributes:
        exact: Names of the columns with a number that cannot be quantised, separated by spaces; they contain
            float64.
        target: A zstandard frame, like all other columns.
    """

    exact: str
    target: bytes
    xyz_mm: bytes
    covariance_mm2: bytes
    calibration_covariance_mm2: bytes
    image_px: bytes
    residual_px: bytes


def encode_points(fields: Sequence[Points]) -> PointColumns:
    """Encodes the points of fields, one field after the other."""
    target = np.concatenate([points.target for points in fields]).astype(np.uint32)
    order = np.argsort(target, kind="stable")
    data, exact = {"target": frame_of(planes_of(target))}, []
    for name, per_unit, size in WHOLE:
        values = np.concatenate([getattr(points, name) for points in fields]).reshape(len(target), size)
        quanta, fits = whole(values, per_unit)
        if fits.all():
            data[name] = _differences(quanta.astype(np.int32).view(np.uint32), order)
        else:
            data[name] = _exact(rounded(values, per_unit))
            exact.append(name)
    for name in COVARIANCES:
        covariance = np.concatenate([getattr(points, name) for points in fields])
        half, near = factors(covariance)
        if near.all():
            data[name] = _differences(half.view(np.uint16), order)
        else:
            data[name] = _exact(rounded_covariance(covariance))
            exact.append(name)
    return PointColumns(exact=" ".join(exact), **data)


def _differences(values: NDArray[np.unsignedinteger], order: NDArray[np.intp]) -> bytes:
    return frame_of(planes_of(differences(values[order])))


def _exact(values: NDArray[np.float64]) -> bytes:
    return frame_of([np.ascontiguousarray(values, "<f8").tobytes()])


def decode_points(columns: PointColumns, count: int) -> Points:
    """Decodes the points of a group, one field after the other.

    Args:
        columns: Result of `encode_points`.
        count: Number of points expected.

    Raises:
        ValueError: The count is out of range, or the columns are damaged or contain a different number.
    """
    if count not in range(MOST_POINTS + 1):
        raise ValueError(f"a group of {count!r} points; there can be {MOST_POINTS}")
    exact = set(columns.exact.split())
    if unknown := exact - set(COLUMNS[1:]):
        raise ValueError(f"there is no column {min(unknown)[:40]!r}")
    try:
        return _decoded(columns, exact, count)
    except ValueError as error:
        raise ValueError(f"damaged points: {error}") from error


def _decoded(columns: PointColumns, exact: set[str], count: int) -> Points:
    target = read_planes(columns.target, "<u4", count)
    order = np.argsort(target, kind="stable")
    values: dict[str, Any] = {}
    for name, per_unit, size in WHOLE:
        data = getattr(columns, name)
        if name in exact:
            values[name] = _read_exact(data, count, size)
        else:
            values[name] = _read_differences(data, "<u4", size, order).view(np.int32) / per_unit
    for name in COVARIANCES:
        data = getattr(columns, name)
        if name in exact:
            elements = _read_exact(data, count, _ELEMENTS)
        else:
            elements = product(_read_differences(data, "<u2", _ELEMENTS, order).view(np.float16))
        values[name] = symmetric(elements)
    values["image_px"] = values["image_px"].reshape(count, 2, 2)
    values["residual_px"] = values["residual_px"].reshape(count)
    return Points(target=target.astype(np.int32), **values)


def _read_differences(
    data: bytes, dtype: str, size: int, order: NDArray[np.intp]
) -> NDArray[np.unsignedinteger]:
    count = len(order)
    folded = read_planes(data, dtype, count * size).reshape(size, count)
    values = np.empty((count, size), folded.dtype.newbyteorder("="))
    values[order] = sums(folded.astype(values.dtype, copy=False))
    return values


def _read_exact(data: bytes, count: int, size: int) -> NDArray[np.float64]:
    return np.frombuffer(unpacked(data, 8 * count * size), "<f8").reshape(count, size).astype(np.float64)
