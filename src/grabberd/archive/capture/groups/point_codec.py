"""Columns of bytes that hold the points of a group of fields.

The points of a target follow each other closely: each column is put in the order of its targets, then of the
fields, and holds the differences from the point before.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.codec import MOST_POINTS, unpacked
from grabberd.archive.capture.groups.frames import differences, frame_of, planes_of, read_planes, sums
from grabberd.archive.capture.groups.quanta import (
    PER_MM,
    PER_PX,
    factors,
    product,
    rounded,
    rounded_covariance,
    symmetric,
    whole,
)
from grabberd.core.reconstruction.points import Points

WHOLE = (("xyz_mm", PER_MM, 3), ("image_px", PER_PX, 4), ("residual_px", PER_PX, 1))
"""Columns of whole quanta: name, quanta per unit, numbers of a point."""
COVARIANCES = ("covariance_mm2", "calibration_covariance_mm2")
_ELEMENTS = 6
COLUMNS = ("target", "xyz_mm", *COVARIANCES, "image_px", "residual_px")
"""In the order of the table."""


class PointColumns(NamedTuple):
    """The points of a group.

    Attributes:
        exact: Names of the columns with a number that no quantum fits, with a space between them; they hold
            their numbers as float64.
        target: A frame; so are all that follow.
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
        columns: What `encode_points` gave.
        count: Number of points expected.

    Raises:
        ValueError: There cannot be so many, or the columns are damaged or hold another number of points.
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
