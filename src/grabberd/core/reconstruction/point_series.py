"""Point series: points of many fields as arrays, fields along one axis, targets along the other."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.points import Points

Array = NDArray[np.float64]

ALL = slice(None)
"""All fields, or all targets."""


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

    def part(self, span: slice, chosen: slice | NDArray[np.intp] = ALL) -> "PointSeries":
        """Select some fields, and some targets by index."""
        return PointSeries(
            self.n[span],
            self.time_s[span],
            self.target[chosen],
            self.xyz_mm[span][:, chosen],
            self.covariance_mm2[span][:, chosen],
            self.calibration_covariance_mm2[span][:, chosen],
            self.image_px[span][:, chosen],
        )

    def without(self, gone: NDArray[np.bool_]) -> "PointSeries":
        """Remove some points (F, T)."""
        kept = np.where(gone, np.nan, 1.0)[:, :, np.newaxis]
        return replace(self, xyz_mm=self.xyz_mm * kept)
