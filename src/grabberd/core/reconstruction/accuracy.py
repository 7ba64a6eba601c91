"""Accuracy of measured points against the truth (the paper's Table 1), and pointing precision at rest (paper
3.5).

Points are compared as they are, or after the rigid motion that best maps them onto the truth: rotation and
shift, never scale.

Length-measuring error between targets, after VDI/VDE 2634 part 1.

The guideline requires at least seven measuring lines of at least five lengths each, spread over the volume
and its directions. Between the targets of an object they are chosen from the true positions alone:

- A line runs from one target to another, divided by the four targets nearest to its fifths. All six differ,
  and the five lengths are measured from its beginning.
- The first line is the longest. Each further one maximises its length times the sine of the least angle to
  the lines chosen before. Lengths and angles are in units of the volume's extents, so that depth counts as
  much as width.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction.points import PointSeries
from grabberd.errors import MeasurementError

_LEAST_EXTENT = 1e-3
"""Ratio of the second to the first principal extent below which points count as lying on one line."""


@dataclass(frozen=True, slots=True, eq=False)
class RigidMotion:
    """X' = R·X + t.

    Attributes:
        rotation: (3, 3), proper: a reflection is not a rigid motion.
        shift_mm: (3,) t.
    """

    rotation: Array
    shift_mm: Array

    def apply(self, xyz_mm: Array) -> Array:
        """Move points (…, 3)."""
        return xyz_mm @ self.rotation.T + self.shift_mm

    def turn(self, covariance_mm2: Array) -> Array:
        """Rotate covariances (…, 3, 3)."""
        return self.rotation @ covariance_mm2 @ self.rotation.T

    @property
    def angle_deg(self) -> float:
        """Angle of rotation, about whatever axis."""
        skew = self.rotation - self.rotation.T
        sine = 0.5 * math.sqrt(0.5 * float((skew * skew).sum()))
        return math.degrees(math.atan2(sine, 0.5 * (float(np.trace(self.rotation)) - 1.0)))


def rigid_motion(from_mm: Array, to_mm: Array) -> RigidMotion:
    """Fit the least-squares motion of N points onto N others (Kabsch 1976).

    Args:
        from_mm: (N, 3).
        to_mm: (N, 3), in the same order.

    Raises:
        MeasurementError: There are fewer than three points, or all lie on one line.
    """
    middle_from, middle_to = from_mm.mean(axis=0), to_mm.mean(axis=0)
    extent = np.linalg.svd(to_mm - middle_to, compute_uv=False) if len(to_mm) >= 3 else np.zeros(3)
    if extent[1] <= _LEAST_EXTENT * extent[0]:
        raise MeasurementError(
            f"{len(to_mm)} points on one line do not determine a rigid motion",
            "compare without a fit, or measure more targets",
        )
    u, _, vt = np.linalg.svd((from_mm - middle_from).T @ (to_mm - middle_to))
    # A determinant of −1 would be a reflection; turning the weakest direction costs the fit least.
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation: Array = (u @ proper @ vt).T
    return RigidMotion(rotation, middle_to - rotation @ middle_from)


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
    xyz_mm: Array

    @classmethod
    def of_series(cls, series: PointSeries) -> "Coordinates":
        """Collect all points of a series, in order of field and target."""
        field, target = np.nonzero(series.seen)
        return cls(series.n, series.n[field], series.target[target], series.xyz_mm[field, target])


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
    xyz_mm: Array
    expected: Mask

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

    def row_of(self, n: NDArray[np.int64], target: NDArray[np.int32]) -> tuple[Indices, Mask]:
        """Find the row of each of K points (field, target), and which points (K,) have one; needs `n`."""
        assert self.n is not None
        if not len(self.target):
            return np.empty(0, np.intp), np.zeros(len(n), np.bool_)
        keys, wanted = _key(self.n, self.target), _key(n, target)
        order = np.argsort(keys)
        nearest = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)]
        known: Mask = keys[nearest] == wanted
        return nearest[known], known


def _key(n: NDArray[np.int64], target: NDArray[np.int32]) -> NDArray[np.int64]:
    # One number for field and target, so that a single sorted search finds both.
    return (n << 32) + target


def true_places(truth: Truth, series: PointSeries) -> Array:
    """(F, T, 3) true positions of a series' targets; NaN where the truth has none."""
    rows = truth.in_fields(series.n)
    fields, targets = series.xyz_mm.shape[:2]
    row, known = rows.row_of(np.repeat(series.n, targets), np.tile(series.target, fields))
    xyz_mm = np.full((fields * targets, 3), np.nan)
    xyz_mm[known] = rows.xyz_mm[row]
    return xyz_mm.reshape(fields, targets, 3)


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


def _right(error: Array) -> Mask:
    return np.linalg.norm(error, axis=1) <= WRONG_BEYOND_MM


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


PAPER_PX = (0.170, 0.225)
"""The paper's values in x and y, from 32 measurements of 108 targets on the calibration frame."""


class PointingPrecision(NamedTuple):
    """Standard deviations in frame pixels, pooled over all targets.

    Attributes:
        fields: Number of measurements.
        targets: Number of targets measured at least twice.
        left_px: x, y in the left view.
        right_px: x, y in the right view.
        both_px: x, y in both views together.
    """

    fields: int
    targets: int
    left_px: tuple[float, float]
    right_px: tuple[float, float]
    both_px: tuple[float, float]


def pointing_precision(series: PointSeries) -> PointingPrecision | None:
    """Run the paper's precision test on an object at rest; None if no target was measured twice.

    Fields of both parities count alike, so quantisation errors that differ between them are included; those
    they share are not.
    """
    field, target = np.nonzero(series.seen)
    image = series.image_px[field, target].reshape(-1, 4)
    variance, freedom = pooled_variance(target, image)
    if not freedom:
        return None
    left, right = variance[:2], variance[2:]
    return PointingPrecision(
        fields=len(series.n),
        targets=int((series.seen.sum(axis=0) > 1).sum()),
        left_px=_sigma(left),
        right_px=_sigma(right),
        both_px=_sigma(0.5 * (left + right)),
    )


def _sigma(variance: Array) -> tuple[float, float]:
    x, y = np.sqrt(variance).tolist()
    return x, y


LINES = 7
LENGTHS = 5
_FLATTEST = 0.02
"""Least extent, as a share of the largest, so that a flat object does not blow up its depth."""


@dataclass(frozen=True, slots=True)
class MeasuredLine:
    """One measuring line.

    Attributes:
        targets: Ids of the six targets, from its beginning to its end.
        length_mm: The five true lengths, averaged over the fields.
        error_mm: For each of them the largest error in any field: measured minus true.
    """

    targets: tuple[int, ...]
    length_mm: tuple[float, ...]
    error_mm: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LengthErrors:
    """Length-measuring error and its required limit.

    Attributes:
        lines: Lines that were measured.
        measured: Number of lengths, counted in every field.
        greatest_mm: The error largest in size.
        limit_mm: Greatest error allowed.
    """

    lines: tuple[MeasuredLine, ...]
    measured: int
    greatest_mm: float
    limit_mm: float

    @property
    def passed(self) -> bool:
        """True if no length is off by more than the limit."""
        return abs(self.greatest_mm) <= self.limit_mm


def length_errors(
    target: NDArray[np.int32], measured_mm: Array, true_mm: Array, limit_mm: float
) -> LengthErrors:
    """Compute the length-measuring error over F fields.

    Args:
        target: (T,) ids.
        measured_mm: (F, T, 3) positions, NaN where a target was not found.
        true_mm: (F, T, 3) true positions, NaN where unknown.
        limit_mm: Greatest error allowed.

    Raises:
        MeasurementError: There are too few targets for seven lines of five lengths.
    """
    both = np.isfinite(measured_mm).all(axis=2) & np.isfinite(true_mm).all(axis=2)
    usable = np.flatnonzero(both.any(axis=0))
    middle = np.nanmean(true_mm[:, usable], axis=0) if len(usable) else np.empty((0, 3))
    lines = usable[measuring_lines(middle)]
    true, measured = _lengths(true_mm, lines), _lengths(measured_mm, lines)
    error = np.where(np.isfinite(true), measured - true, np.nan)
    count = int(np.isfinite(error).sum())
    worst = _farthest(error)
    if not np.isfinite(worst).all():
        raise MeasurementError(
            f"{int(np.isnan(worst).sum())} of {worst.size} lengths could be measured in no field, because "
            "their targets were never found together",
            "capture more fields, or place the object where all targets are visible",
        )
    return LengthErrors(
        lines=tuple(
            MeasuredLine(tuple(target[line].tolist()), tuple(length.tolist()), tuple(off.tolist()))
            for line, length, off in zip(lines, np.nanmean(true, axis=0), worst, strict=True)
        ),
        measured=count,
        greatest_mm=float(worst.ravel()[np.abs(worst).argmax()]),
        limit_mm=limit_mm,
    )


def measuring_lines(xyz_mm: Array) -> Indices:
    """Choose seven measuring lines, as (7, 6) indices of targets, from the true positions (T, 3).

    Raises:
        MeasurementError: There are fewer than seven lines of five lengths in different directions.
    """
    candidates = _candidates(xyz_mm)
    scaled = _scaled(xyz_mm)
    along = scaled[candidates[:, -1]] - scaled[candidates[:, 0]]
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, np.newaxis]
    worth = length.copy()
    chosen: list[int] = []
    while len(chosen) < LINES and len(worth) and worth.max() > 0:
        chosen.append(int(worth.argmax()))
        cosine = unit @ unit[chosen[-1]]
        worth = np.minimum(worth, length * np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))
        worth[worth < 1e-6 * length] = 0.0
    if len(chosen) < LINES:
        raise MeasurementError(
            f"between {len(xyz_mm)} targets there are {len(chosen)} measuring lines of {LENGTHS} lengths in "
            f"different directions; {LINES} are needed",
            "use an object with more targets, or make sure that more of them are found",
        )
    return candidates[chosen]


def _candidates(xyz_mm: Array) -> Indices:
    """(C, 6) all pairs of targets with the four that divide the line between them, where all six differ."""
    if len(xyz_mm) <= LENGTHS:
        return np.empty((0, LENGTHS + 1), np.intp)
    first, last = np.triu_indices(len(xyz_mm), 1)
    lines = [first]
    for share in np.arange(1, LENGTHS) / LENGTHS:
        point = xyz_mm[first] + share * (xyz_mm[last] - xyz_mm[first])
        lines.append(((xyz_mm - point[:, np.newaxis]) ** 2).sum(axis=2).argmin(axis=1))
    candidates = np.stack([*lines, last], axis=1)
    ordered = np.sort(candidates, axis=1)
    return candidates[(np.diff(ordered, axis=1) > 0).all(axis=1)]


def _scaled(xyz_mm: Array) -> Array:
    if not len(xyz_mm):
        return xyz_mm
    extent = np.ptp(xyz_mm, axis=0)
    return xyz_mm / np.maximum(extent, max(_FLATTEST * extent.max(), 1e-9))


def _lengths(xyz_mm: Array, lines: Indices) -> Array:
    """(F, L, 5) lengths from the first target of each line to its others."""
    ends = xyz_mm[:, lines]
    return np.linalg.norm(ends[:, :, 1:] - ends[:, :, :1], axis=3)


def _farthest(error: Array) -> Array:
    """(L, 5) value largest in size over F fields; NaN where there is none."""
    size = np.where(np.isfinite(error), np.abs(error), -1.0).argmax(axis=0)
    return np.take_along_axis(error, size[np.newaxis], axis=0)[0]
