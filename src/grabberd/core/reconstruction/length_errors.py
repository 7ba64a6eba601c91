"""Length-measuring error between targets, after VDI/VDE 2634 part 1.

The guideline requires at least seven measuring lines of at least five lengths each, spread over the volume
and its directions. Between the targets of an object they are chosen from the true positions alone:

- A line runs from one target to another, divided by the four targets nearest to its fifths. All six differ,
  and the five lengths are measured from its beginning.
- The first line is the longest. Each further one maximises its length times the sine of the least angle to
  the lines chosen before. Lengths and angles are in units of the volume's extents, so that depth counts as
  much as width.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import MeasurementError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

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
