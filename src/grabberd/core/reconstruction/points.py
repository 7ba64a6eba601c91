"""Points: positions of targets in space, of one field or of many as a series; and why a target has none."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class SingleViewImages:
    """Images of N targets that one view alone sees in a field, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        view: (N,) the view that sees each, 0 left, 1 right.
        image_px: (N, 2) float64, frame pixels x and y, corrected by the view's local field if it has one.
        sigma_px: (N, 2) float64, their standard deviation, line jitter included.
    """

    target: NDArray[np.int32]
    view: NDArray[np.intp]
    image_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.target)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """N points of one field, in the object's frame, sorted by target.

    Attributes:
        target: (N,) int32, target ids, each at most once.
        xyz_mm: (N, 3) float64.
        covariance_mm2: (N, 3, 3) float64, from pointing and line jitter: independent from field to field.
        calibration_covariance_mm2: (N, 3, 3) float64, from the calibration: common to all fields and not
            reduced by averaging, hence kept separate.
        image_px: (N, 2, 2) float64, frame pixels of the blobs it was intersected from: [point, view, (x, y)],
            view 0 left, 1 right; corrected by the views' local fields if the calibration has them.
        residual_px: (N,) float64, root mean square of the four image residuals after intersection.
        single: images of further targets, which one view alone sees; None if they have not been sought.
    """

    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    calibration_covariance_mm2: NDArray[np.float64]
    image_px: NDArray[np.float64]
    residual_px: NDArray[np.float64]
    single: SingleViewImages | None = None

    @classmethod
    def joined(cls, parts: Sequence["Points"]) -> "Points":
        """Join the points of some fields, in order and without their single views."""
        columns: Any = (np.concatenate([getattr(one, name) for one in parts]) for name in _COLUMNS)
        return cls(*columns)

    def __len__(self) -> int:
        return len(self.target)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Points":
        """Select points by a mask or ascending index array."""
        columns: Any = [getattr(self, name)[chosen] for name in _COLUMNS]
        return Points(*[*columns, self.single])

    @classmethod
    def none(cls) -> "Points":
        """Make an empty set of points."""
        return cls(
            np.empty(0, np.int32),
            np.empty((0, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 3, 3)),
            np.empty((0, 2, 2)),
            np.empty(0),
        )


_COLUMNS = ("target", "xyz_mm", "covariance_mm2", "calibration_covariance_mm2", "image_px", "residual_px")
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PointSeries:
    """Points of F fields and T targets; NaN where a target has no point in a field.

    Attributes:
        n: (F,) int64, field numbers, ascending, including fields without any point.
        time_s: (F,) time since the first field.
        target: (T,) int32, ids, ascending, of all targets with a point in any field.
        xyz_mm: (F, T, 3), in the object's frame.
        covariance_mm2: (F, T, 3, 3), see `Points`.
        calibration_covariance_mm2: (F, T, 3, 3), see `Points`.
        image_px: (F, T, 2, 2), [field, target, view, (x, y)].
    """

    n: NDArray[np.int64]
    time_s: Array
    target: NDArray[np.int32]
    xyz_mm: Array
    covariance_mm2: Array
    calibration_covariance_mm2: Array
    image_px: Array

    @classmethod
    def of(cls, measured: Iterable[tuple[int, int, Points]]) -> "PointSeries":
        """Collect from field numbers, times in ns, and points, in order."""
        rows = list(measured)
        points = [of_field for _, _, of_field in rows]
        target = np.unique(np.concatenate([np.empty(0, np.int32), *(one.target for one in points)]))
        columns = [np.searchsorted(target, one.target) for one in points]

        def spread(name: str, *shape: int) -> Array:
            series = np.full((len(points), len(target), *shape), np.nan)
            for of_field, column, one in zip(series, columns, points, strict=True):
                of_field[column] = getattr(one, name)
            return series

        times_ns = np.array([time_ns for _, time_ns, _ in rows], np.int64)
        return cls(
            n=np.array([n for n, _, _ in rows], np.int64),
            time_s=(times_ns - times_ns[:1]) / 1e9,
            target=target,
            xyz_mm=spread("xyz_mm", 3),
            covariance_mm2=spread("covariance_mm2", 3, 3),
            calibration_covariance_mm2=spread("calibration_covariance_mm2", 3, 3),
            image_px=spread("image_px", 2, 2),
        )

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(F, T) True where a target has a point in a field."""
        return np.isfinite(self.xyz_mm[:, :, 0])

    @property
    def parity(self) -> NDArray[np.intp]:
        """(F,) 0 or 1: fields of equal parity show the same lines, unless they are progressive pictures."""
        return (self.n & 1).astype(np.intp)

    def without(self, gone: NDArray[np.bool_]) -> "PointSeries":
        """Remove some points (F, T)."""
        kept = np.where(gone, np.nan, 1.0)[:, :, np.newaxis]
        return replace(self, xyz_mm=self.xyz_mm * kept)


class Miss(IntEnum):
    """Outcome of the search for one target in one field.

    The first ones are also those of the compiled kernel (space.h): one bit for each view without a blob.
    """

    FOUND = 0
    NO_BLOB_LEFT = 1
    """No blob near its predicted image in the left view."""
    NO_BLOB_RIGHT = 2
    NO_BLOB = 3
    """None in either view."""
    RAYS_APART = 4
    """There is a blob in both views, but their rays do not meet."""
    OFF_PLACE = 5
    """The rays meet too far from where its neighbours put it."""
    UNCONFIRMED = 6
    """Found, but only once after a long time and hence not reported: it may have been a false blob."""
    NOT_IDENTIFIED = 7
    """No target was identified in the whole field."""
    CUT_OFF = 8
    """Its predicted image is cut off by the edge of its view."""
    UNPREDICTED = 9
    """Its neighbours are too far away to predict it."""

    @property
    def key(self) -> str:
        """Its name in documents."""
        return self.name.lower()
