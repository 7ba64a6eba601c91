"""Length-measuring error between targets, after VDI/VDE 2634 part 1.

The guideline asks for at least seven measuring lines of at least five lengths each, spread over the volume
and its directions. Between the targets of an object they are chosen like this, from the true places alone:

- A line goes from a target to another; four more targets divide it, those nearest to its fifths. All six are
  different, and the five lengths are those from its beginning.
- The first line is the longest. Each further one is that of which the length, times the sine of the least
  angle to the lines chosen before, is greatest. Lengths and angles are in units of the volume's extents: so
  depth counts as much as width.
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
"""Extents below this share of the largest count as this share."""


@dataclass(frozen=True, slots=True)
class MeasuredLine:
    """One measuring line.

    Attributes:
        targets: ids of the six targets, from its beginning to its end.
        length_mm: the five true lengths, in the mean of the fields.
        error_mm: for each of them the error that is farthest from 0 in all fields: measured minus true.
    """

    targets: tuple[int, ...]
    length_mm: tuple[float, ...]
    error_mm: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LengthErrors:
    """The length-measuring error and what it is held against.

    Attributes:
        lines: that were measured.
        measured: how many lengths, fields counted.
        greatest_mm: the error farthest from 0 of all.
        limit_mm: what is required.
    """

    lines: tuple[MeasuredLine, ...]
    measured: int
    greatest_mm: float
    limit_mm: float

    @property
    def passed(self) -> bool:
        """Whether no length is off by more than the limit."""
        return abs(self.greatest_mm) <= self.limit_mm


def length_errors(
    target: NDArray[np.int32], measured_mm: Array, true_mm: Array, limit_mm: float
) -> LengthErrors:
    """The length-measuring error of F fields.

    Args:
        target: (T,) ids.
        measured_mm: (F, T, 3) places, NaN where a target was not found.
        true_mm: (F, T, 3) true places, NaN where they are not known.
        limit_mm: the greatest error that is allowed.

    Raises:
        MeasurementError: too few targets for seven lines of five lengths.
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
            "capture more fields, or bring the object where all targets are seen",
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
    """(7, 6) indices of the targets of seven measuring lines, from the true places (T, 3).

    Raises:
        MeasurementError: there are not seven lines of five lengths in different directions.
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
            "take an object with more targets, or see that more of them are found",
        )
    return candidates[chosen]


def _candidates(xyz_mm: Array) -> Indices:
    """(C, 6) all pairs of targets with the four that divide the way between them, where all six differ."""
    if len(xyz_mm) <= LENGTHS:
        return np.empty((0, LENGTHS + 1), np.intp)
    first, last = np.triu_indices(len(xyz_mm), 1)
    lines = [first]
    for share in np.arange(1, LENGTHS) / LENGTHS:
        point = xyz_mm[first] + share * (xyz_mm[last] - xyz_mm[first])
        lines.append(((xyz_mm - point[:, np.newaxis]) ** 2).sum(axis=2).argmin(axis=1))
    candidates = np.stack([*lines, last], axis=1)
    ordered = np.sort(candidates, axis=1)
    different: Indices = candidates[(np.diff(ordered, axis=1) > 0).all(axis=1)]
    return different


def _scaled(xyz_mm: Array) -> Array:
    if not len(xyz_mm):
        return xyz_mm
    extent = np.ptp(xyz_mm, axis=0)
    scaled: Array = xyz_mm / np.maximum(extent, max(_FLATTEST * extent.max(), 1e-9))
    return scaled


def _lengths(xyz_mm: Array, lines: Indices) -> Array:
    """(F, L, 5) from the first target of each line to its others."""
    ends = xyz_mm[:, lines]
    lengths: Array = np.linalg.norm(ends[:, :, 1:] - ends[:, :, :1], axis=3)
    return lengths


def _farthest(error: Array) -> Array:
    """(L, 5) of F fields the value farthest from 0; NaN where there is none."""
    size = np.where(np.isfinite(error), np.abs(error), -1.0).argmax(axis=0)
    farthest: Array = np.take_along_axis(error, size[np.newaxis], axis=0)[0]
    return farthest
