"""Accuracy of measured points against the truth: the paper's Table 1."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.accuracy.ground_truth import Coordinates, Truth
from grabberd.core.reconstruction.accuracy.rigid_motion import RigidMotion, rigid_motion
from grabberd.errors import MeasurementError

Array = NDArray[np.float64]

WRONG_BEYOND_MM = 2.0
"""Distance from its target beyond which a point has another target's id; the pitch is 6.5 mm."""
LEAST_RIGHT = 0.2
"""Share of points near their target below which truth and points do not belong together."""


class Axes(NamedTuple):
    """One number per axis, and one for all three combined: xyz² = x² + y² + z²."""

    x_mm: float
    y_mm: float
    z_mm: float
    xyz_mm: float

    @classmethod
    def of(cls, variance_mm2: Array) -> "Axes":
        """Take the square roots of the variances (3,) of X, Y and Z."""
        x, y, z = np.sqrt(variance_mm2).tolist()
        return cls(x, y, z, float(np.sqrt(variance_mm2.sum())))


PAPER_RMSE = Axes(0.056, 0.101, 0.082, 0.141)
PAPER_PRECISION = Axes(0.051, 0.035, 0.135, 0.148)
"""The paper's own Table 1."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """The numbers of the paper's Table 1, with counts of points found, missing and wrong.

    Attributes:
        fields: Number of fields compared.
        matched: Number of points within `WRONG_BEYOND_MM` of their target's true position.
        missing: Number of expected targets without a point, counted in every field.
        wrong: Number of points farther away, which carry another target's id and count nowhere else.
        unknown: Number of points of targets that the truth does not contain.
        rmse: Root mean square of the matched points' errors.
        precision: Standard deviation of repeated measurements of one target, pooled over all; None if the
            object moves or no target was measured twice.
        fitted: Rigid motion applied to the points before the comparison, or None.
    """

    fields: int
    matched: int
    missing: int
    wrong: int
    unknown: int
    rmse: Axes
    precision: Axes | None
    fitted: RigidMotion | None = None


def accuracy(measured: Coordinates, truth: Truth, *, fit: bool = False) -> Accuracy:
    """Compare points with the truth, as they are or after one rigid motion of all fields; never scaled.

    Raises:
        MeasurementError: No or too few points match, or the points do not determine a rigid motion.
    """
    if not len(measured.n):
        raise MeasurementError(
            f"there is no point in {len(measured.fields)} fields",
            "check that calibration and object model belong to this capture's rig and object",
        )
    rows = truth.in_fields(measured.fields)
    row, known = rows.row_of(measured.n, measured.target)
    xyz_mm, true = measured.xyz_mm[known], rows.xyz_mm[row]
    fitted = _fitted(xyz_mm, true) if fit else None
    error = (fitted.apply(xyz_mm) if fitted else xyz_mm) - true
    right = _right(error)
    if right.sum() <= LEAST_RIGHT * len(right):
        raise MeasurementError(
            f"{right.sum() or 'none'} of {len(measured.n)} points in {len(measured.fields)} fields "
            f"{'are' if right.any() else 'is'} within {WRONG_BEYOND_MM} mm of its target's true place",
            "check that truth and points agree in the object's frame, target ids and field numbers",
        )
    with_point = np.zeros(len(rows.target), np.bool_)
    with_point[row] = True
    return Accuracy(
        fields=len(measured.fields),
        matched=int(right.sum()),
        missing=int((rows.expected & ~with_point).sum()),
        wrong=int((~right).sum()),
        unknown=int((~known).sum()),
        rmse=Axes.of((error[right] ** 2).mean(axis=0)),
        precision=_precision(measured.target[known][right], error[right]) if truth.still else None,
        fitted=fitted,
    )


def _right(error: Array) -> NDArray[np.bool_]:
    right: NDArray[np.bool_] = np.linalg.norm(error, axis=1) <= WRONG_BEYOND_MM
    return right


def _fitted(xyz_mm: Array, true: Array) -> RigidMotion:
    """Rigid motion of all points onto the truth, repeated with those that it brings there."""
    first = rigid_motion(xyz_mm, true)
    right = _right(first.apply(xyz_mm) - true)
    return rigid_motion(xyz_mm[right], true[right]) if right.any() else first


def pooled_variance(group: NDArray[np.generic], values: Array) -> tuple[Array, int]:
    """Pool the variance about each group's own mean; each group costs one degree of freedom.

    Args:
        group: (K,) group of each row.
        values: (K, C).

    Returns:
        (C,) variance, NaN if nothing was measured twice, and the degrees of freedom.
    """
    _, index, count = np.unique(group, return_inverse=True, return_counts=True)
    freedom = int((count - 1).sum())
    means = np.stack([np.bincount(index, column) / count for column in values.T], axis=1)
    squares = ((values - means[index]) ** 2).sum(axis=0)
    return squares / freedom if freedom else np.full(values.shape[1], np.nan), freedom


def _precision(target: NDArray[np.int32], error: Array) -> Axes | None:
    variance, freedom = pooled_variance(target, error)
    return Axes.of(variance) if freedom else None
