"""Stored points: the resolution of each number, and the columns of bytes that contain them.

Positions are multiples of 10⁻⁴ mm, 1/500 of the σ of one field; image coordinates and residuals of 10⁻³ px,
1/100 of their σ. Covariances are stored as Cholesky factors in half precision, accurate to 10⁻³ of the
product of the two σ; the result is symmetric without negative variances, however thin the ellipsoid is. A
number that does not fit is stored exactly. Each number is rounded independently, so a point does not depend
on the others stored with it. Columns are sorted by target, then by field, and contain differences from the
previous point, which are small within a target.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.codec import (
    MOST_POINTS,
    UPPER,
    differences,
    frame_of,
    planes_of,
    read_planes,
    sums,
    symmetric,
    unpacked,
)
from grabberd.core.reconstruction.points import Points

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
