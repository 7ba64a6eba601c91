"""Measured points against the truth: the paper's Table 1."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError
from grabberd.reconstruction.points import Points

WRONG_BEYOND_MM = 2.0
"""A point farther from its target than this has another target's id; the pitch is 6.5 mm."""


@dataclass(frozen=True, slots=True, eq=False)
class Coordinates:
    """Points of many fields.

    Attributes:
        fields: (F,) int64, numbers of all fields that were measured, those without a point too.
        n: (K,) int64, each point's field.
        target: (K,) int32, its target; a target is at most once in a field.
        xyz_mm: (K, 3) float64, in the object's frame.
    """

    fields: NDArray[np.int64]
    n: NDArray[np.int64]
    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]

    @classmethod
    def of(cls, measured: Iterable[tuple[int, Points]]) -> "Coordinates":
        """From field numbers and their points."""
        pairs = list(measured)
        points = [Points.none(), *(points for _, points in pairs)]
        return cls(
            fields=np.array([n for n, _ in pairs], np.int64),
            n=np.repeat([0, *(n for n, _ in pairs)], [len(one) for one in points]).astype(np.int64),
            target=np.concatenate([one.target for one in points]),
            xyz_mm=np.concatenate([one.xyz_mm for one in points]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Where the targets really were.

    Attributes:
        n: (K,) int64, field of each row; None: the object stood still and a row holds for every field.
        target: (K,) int32; `xyz_mm`: (K, 3) float64, in the object's frame.
        expected: (K,) bool, it could be seen in both views, so that its absence is a miss.
    """

    n: NDArray[np.int64] | None
    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]
    expected: NDArray[np.bool_]

    def in_fields(self, fields: NDArray[np.int64]) -> "Truth":
        """The rows of these fields, one for each field and target."""
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


class Axes(NamedTuple):
    """A number for each axis and for all three together: xyz² = x² + y² + z²."""

    x_mm: float
    y_mm: float
    z_mm: float
    xyz_mm: float


@dataclass(frozen=True, slots=True)
class Accuracy:
    """What Table 1 of the paper says, and what was found at all.

    Attributes:
        fields: fields compared.
        matched: points that are within `WRONG_BEYOND_MM` of their target's true place.
        missing: expected targets, counted in every field, that have no point.
        wrong: points farther away: somebody else's id; they are in no other number.
        unknown: points of targets that the truth does not have.
        rmse: root mean square of the matched points' errors.
        precision: standard deviation of repeated measurements of one target, pooled over all; None where the
            object moves or no target was measured twice.
    """

    fields: int
    matched: int
    missing: int
    wrong: int
    unknown: int
    rmse: Axes
    precision: Axes | None


def accuracy(measured: Coordinates, truth: Truth) -> Accuracy:
    """Compares points with the truth as they are: nothing is fitted, nothing scaled.

    Raises:
        MeasurementError: not one point could be matched.
    """
    rows = truth.in_fields(measured.fields)
    row, known = _rows_of(measured, rows)
    error = measured.xyz_mm[known] - rows.xyz_mm[row]
    right = np.linalg.norm(error, axis=1) <= WRONG_BEYOND_MM
    if not right.any():
        raise MeasurementError(
            f"none of {len(measured.n)} points in {len(measured.fields)} fields is within "
            f"{WRONG_BEYOND_MM} mm of its target's true place",
            "check that truth and points agree in the object's frame, target ids and field numbers",
        )
    found = np.zeros(len(rows.target), np.bool_)
    found[row] = True
    still = truth.n is None
    return Accuracy(
        fields=len(measured.fields),
        matched=int(right.sum()),
        missing=int((rows.expected & ~found).sum()),
        wrong=int((~right).sum()),
        unknown=int((~known).sum()),
        rmse=_axes((error[right] ** 2).mean(axis=0)),
        precision=_precision(measured.target[known][right], error[right]) if still else None,
    )


def _rows_of(measured: Coordinates, rows: Truth) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The truth's row for every point that has one, and which points have."""
    assert rows.n is not None
    if not len(rows.target):
        return np.empty(0, np.intp), np.zeros(len(measured.n), np.bool_)
    keys, wanted = _key(rows.n, rows.target), _key(measured.n, measured.target)
    order = np.argsort(keys)
    place = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)]
    known: NDArray[np.bool_] = keys[place] == wanted
    return place[known], known


def _key(n: NDArray[np.int64], target: NDArray[np.int32]) -> NDArray[np.int64]:
    return (n << 32) + target


def _precision(target: NDArray[np.int32], error: NDArray[np.float64]) -> Axes | None:
    """Standard deviation about each target's own mean, every target losing one degree of freedom."""
    _, index, count = np.unique(target, return_inverse=True, return_counts=True)
    freedom = int((count - 1).sum())
    if freedom == 0:
        return None
    means = np.stack([np.bincount(index, axis) / count for axis in error.T], axis=1)
    return _axes(((error - means[index]) ** 2).sum(axis=0) / freedom)


def _axes(variance: NDArray[np.float64]) -> Axes:
    x, y, z = np.sqrt(variance).tolist()
    return Axes(x, y, z, float(np.sqrt(variance.sum())))
