"""Ground truth: the targets' real positions, and the measured ones that are compared with them."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.point_series import PointSeries
from grabberd.core.reconstruction.points import Points

_STILL_MM = 1e-6
"""Movement below this counts as standing still."""


@dataclass(frozen=True, slots=True, eq=False)
class Coordinates:
    """Measured points of many fields.

    Attributes:
        fields: (F,) int64, numbers of all measured fields, including those without a point.
        n: (K,) int64, field of each point.
        target: (K,) int32, its target, at most once per field.
        xyz_mm: (K, 3) float64, in the object's frame.
    """

    fields: NDArray[np.int64]
    n: NDArray[np.int64]
    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]

    @classmethod
    def of(cls, measured: Iterable[tuple[int, Points]]) -> "Coordinates":
        """Collect from field numbers and their points."""
        pairs = list(measured)
        points = [Points.none(), *(points for _, points in pairs)]
        return cls(
            fields=np.array([n for n, _ in pairs], np.int64),
            n=np.repeat([0, *(n for n, _ in pairs)], [len(one) for one in points]).astype(np.int64),
            target=np.concatenate([one.target for one in points]),
            xyz_mm=np.concatenate([one.xyz_mm for one in points]),
        )

    @classmethod
    def of_series(cls, series: PointSeries) -> "Coordinates":
        """Collect all points of a series, in order of field and target."""
        field, target = np.nonzero(series.seen)
        return cls(series.n, series.n[field], series.target[target], series.xyz_mm[field, target])

    def at(self, xyz_mm: NDArray[np.float64]) -> "Coordinates":
        """Copy with other positions (K, 3)."""
        return replace(self, xyz_mm=xyz_mm)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """True positions of the targets.

    Attributes:
        n: (K,) int64, field of each row; None if the object stood still and a row holds for every field.
        target: (K,) int32, target ids.
        xyz_mm: (K, 3) float64, in the object's frame.
        expected: (K,) bool, True if the target was visible in both views, so that its absence is a miss.
    """

    n: NDArray[np.int64] | None
    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]
    expected: NDArray[np.bool_]

    @property
    def still(self) -> bool:
        """True if every target keeps its position in all fields."""
        if self.n is None:
            return True
        order = np.argsort(self.target, kind="stable")
        moved = np.abs(np.diff(self.xyz_mm[order], axis=0)).max(axis=1, initial=0.0)
        return not (moved[np.diff(self.target[order]) == 0] > _STILL_MM).any()

    def in_fields(self, fields: NDArray[np.int64]) -> "Truth":
        """Expand or select the rows of these fields, one for each field and target."""
        if self.n is not None:
            chosen = np.isin(self.n, fields)
            return Truth(self.n[chosen], self.target[chosen], self.xyz_mm[chosen], self.expected[chosen])
        count = len(fields)
        return Truth(
            np.repeat(fields, len(self.target)),
            np.tile(self.target, count),
            np.tile(self.xyz_mm, (count, 1)),
            np.tile(self.expected, count),
        )

    def row_of(
        self, n: NDArray[np.int64], target: NDArray[np.int32]
    ) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Find the row of each of K points (field, target), and which points (K,) have one; needs `n`."""
        assert self.n is not None
        if not len(self.target):
            return np.empty(0, np.intp), np.zeros(len(n), np.bool_)
        keys, wanted = _key(self.n, self.target), _key(n, target)
        order = np.argsort(keys)
        nearest = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)]
        known: NDArray[np.bool_] = keys[nearest] == wanted
        return nearest[known], known


def _key(n: NDArray[np.int64], target: NDArray[np.int32]) -> NDArray[np.int64]:
    # One number for field and target, so that a single sorted search finds both.
    return (n << 32) + target


def true_places(truth: Truth, series: PointSeries) -> NDArray[np.float64]:
    """(F, T, 3) true positions of a series' targets; NaN where the truth has none."""
    rows = truth.in_fields(series.n)
    fields, targets = series.xyz_mm.shape[:2]
    row, known = rows.row_of(np.repeat(series.n, targets), np.tile(series.target, fields))
    xyz_mm = np.full((fields * targets, 3), np.nan)
    xyz_mm[known] = rows.xyz_mm[row]
    return xyz_mm.reshape(fields, targets, 3)
