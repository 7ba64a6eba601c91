"""Buckling of the empty liner and touch of its walls, from the levels of a slow ramp of the pressure
difference.

Both are read from the height of the wall over the plane of symmetry. That falls ever faster once the wall
buckles, so the pressure difference is taken as a function of the height: between buckling and touch it is a
smooth one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.wall_model import Difference
from grabberd_liner.analysis.wall.material import Material

_TERMS = 3
"""Of a row's height round the wall: level, slope, bend."""
_CREST_MM = 10.0
"""To both sides of the line that faces the cameras: farther out a collapsing wall folds, and is no parabola.

With targets at ±16 mm as well, the touch came out 2 to 4 kPa too high.
"""


class RampLevel(NamedTuple):
    """One state of the ramp: the targets, and the pressure difference, whose σ is of this level alone."""

    points: Points
    difference: Difference


def row_heights(mounting: Mounting, grid: Grid, levels: Sequence[RampLevel]) -> Estimate:
    """(L, R) heights of the inner face over the plane of symmetry, on the line that faces the cameras, mm.

    A parabola through the targets of a row that are near that line gives the height of its outer face there;
    NaN where fewer than three were seen. σ is that of the points.
    """
    rows = int(grid.row.max()) + 1
    near = [_near_crest(mounting, grid, level.points) for level in levels]
    each = [_of_level(mounting, grid, points, rows) for points in near]
    value, sigma = (np.array(part).reshape(len(levels), rows) for part in zip(*each, strict=True))
    return Estimate(value, sigma)


def crest_heights(
    grid: Grid, material: Material, reference: Points | None, levels: Sequence[RampLevel]
) -> Estimate:
    """(L,) heights of the inner face as `row_heights` has them, of the row whose walls meet first."""
    mounting = Mounting.of(grid, material, reference)
    heights = row_heights(mounting, grid, levels)
    kpa = np.array([level.difference.kpa for level in levels])
    row = _first_to_touch(heights.value, kpa, mounting.half.tube.radius_mm)
    return Estimate(heights.value[:, row], heights.sigma[:, row])


def _near_crest(mounting: Mounting, grid: Grid, points: Points) -> Points:
    return points.select(np.abs(mounting.targets.s_mm[grid.indices(points.target)]) < _CREST_MM)


def _of_level(mounting: Mounting, grid: Grid, points: Points, rows: int) -> tuple[Array, Array]:
    value, sigma = np.full(rows, np.nan), np.full(rows, np.nan)
    places = mounting.frame.places(points.xyz_mm)
    variance = mounting.frame.covariances(points.covariance_mm2)[:, 2, 2]
    row = grid.row[grid.indices(points.target)]
    design = np.vander(places[:, 1], _TERMS, increasing=True)
    weighted = design / variance[:, np.newaxis]
    normal, right = np.zeros((rows, _TERMS, _TERMS)), np.zeros((rows, _TERMS))
    np.add.at(normal, row, weighted[:, :, np.newaxis] * design[:, np.newaxis])
    np.add.at(right, row, weighted * places[:, 2:])
    enough = np.bincount(row, minlength=rows) >= _TERMS
    covariance = np.linalg.pinv(normal[enough])
    value[enough] = (covariance[:, 0] * right[enough]).sum(axis=1) - mounting.face_mm
    sigma[enough] = np.sqrt(covariance[:, 0, 0])
    return value, sigma


_HINT = "let the pressure difference rise slowly from 0 until opposite walls touch"
_OPEN_SHARE = 0.5
"""Of the pressure difference that buckles: up to there the open wall's height is a straight line."""
_BEND, _STEEPEST = (0.07, 0.45), 0.24
"""Of the radius: fall of the wall in which it buckles, and where it falls most steeply over the pressure
difference.

Liners of radius by thickness 4.8 to 5.8 fall most steeply at .22 to .27. A minimum sought in noisy data is
too steep.
"""
_NEAR_TOUCH, _DRAWN_TO, _TOUCHING = 0.35, 0.07, 0.02
"""Of the radius: heights from which and down to which the wall is drawn on to the touch, and below which it
counts as touching.

After the touch a wall comes on slowly, and is a little over the plane if the axis is not where it was said.
"""
_LEAST_SIGMA_KPA = 1e-3


class Collapse(NamedTuple):
    """The liner's own pressure differences.

    Attributes:
        touch_kpa: TPPD, at which opposite walls just touch.
        buckling_kpa: CCPD, at which the open wall's line meets the steepest fall of the buckling one.
        touch_common_kpa, buckling_common_kpa: part of their σ that other ramps share: by the gauge, and for
            the touch by the wall's thickness.
    """

    touch_kpa: Estimate
    buckling_kpa: Estimate
    touch_common_kpa: float
    buckling_common_kpa: float


def collapse(
    grid: Grid,
    material: Material,
    reference: Points | None,
    levels: Sequence[RampLevel],
    common_sigma_kpa: float,
) -> Collapse:
    """The collapse of the liner, at the row of targets where its walls meet first.

    Args:
        grid: targets of the object model, on a cylinder.
        material: of the wall, whose thickness and its σ count.
        reference: targets of the open liner; None for the object model's.
        levels: of the ramp, in any order.
        common_sigma_kpa: σ of the pressure difference that all levels share, the gauge's.

    Raises:
        AnalysisError: the ramp does not reach touch or buckling, or has too few levels there.
    """
    mounting = Mounting.of(grid, material, reference)
    radius_mm = mounting.half.tube.radius_mm
    heights = row_heights(mounting, grid, levels)
    kpa = np.array([level.difference.kpa for level in levels])
    own_kpa = np.array([max(level.difference.sigma_kpa, _LEAST_SIGMA_KPA) for level in levels])
    row = _first_to_touch(heights.value, kpa, radius_mm)
    seen = np.isfinite(heights.value[:, row])
    curve = _Curve(kpa[seen], own_kpa[seen], heights.value[seen, row], heights.sigma[seen, row])
    touch, slope = _touch(curve, radius_mm)
    buckling = _buckling(curve.before_touch(radius_mm), radius_mm)
    common_kpa = float(np.hypot(common_sigma_kpa, slope * material.wall_sigma_mm)), common_sigma_kpa
    touch, buckling = (
        Estimate(one.value, np.hypot(one.sigma, shared_kpa))
        for one, shared_kpa in zip((touch, buckling), common_kpa, strict=True)
    )
    return Collapse(touch, buckling, *common_kpa)


def _first_to_touch(height_mm: Array, kpa: Array, radius_mm: float) -> int:
    """The row whose walls meet first.

    It is lowest on the way to the touch. Later others come as low, and noise would choose among them.
    """
    rising = np.nan_to_num(height_mm, nan=np.inf)[np.argsort(kpa)]
    least_mm = rising.min(axis=1)
    touching = np.flatnonzero(least_mm < _TOUCHING * radius_mm)
    before = rising[: touching[0] + 1] if len(touching) else rising
    near = before[before.min(axis=1) < _NEAR_TOUCH * radius_mm]
    return int((near if len(near) else before[-1:]).mean(axis=0).argmin())


class _Curve(NamedTuple):
    """Pressure differences and heights of L levels with their σ."""

    kpa: Array
    own_kpa: Array
    height_mm: Array
    sigma_mm: Array

    def only(self, which: Mask) -> "_Curve":
        return _Curve(*(part[which] for part in self))

    def before_touch(self, radius_mm: float) -> "_Curve":
        return self.only(self.height_mm > _TOUCHING * radius_mm)

    def polynomial(self, over_mm: Array, order: int) -> tuple[Array, Array]:
        """Terms of the pressure difference over a length (L,), the constant first, and their covariance."""
        sigma = self.own_kpa
        for _ in range(3):
            design = np.vander(over_mm, order + 1, increasing=True)
            covariance = np.asarray(
                np.linalg.inv((design / sigma[:, np.newaxis] ** 2).T @ design), np.float64
            )
            found = covariance @ (design.T @ (self.kpa / sigma**2))
            slope = np.polynomial.polynomial.polyval(over_mm, np.polynomial.polynomial.polyder(found))
            sigma = np.hypot(self.own_kpa, slope * self.sigma_mm)
        # Levels that scatter by more than their σ say so themselves.
        left = ((self.kpa - design @ found) / sigma) ** 2
        beyond = max(1.0, float(left.sum()) / max(len(left) - order - 1, 1))
        return found, covariance * beyond


def _touch(curve: _Curve, radius_mm: float) -> tuple[Estimate, float]:
    """Pressure difference at height 0, and its slope over the height."""
    near = curve.before_touch(radius_mm)
    near = near.only(near.height_mm < _NEAR_TOUCH * radius_mm)
    drawn = near.only(near.height_mm > _DRAWN_TO * radius_mm)
    if len(drawn.kpa) < 4:
        raise AnalysisError(
            f"the touch of opposite walls cannot be read: {len(drawn.kpa)} levels have walls that are less "
            f"than {2 * _NEAR_TOUCH * radius_mm:.1f} mm apart and do not touch, 4 are needed",
            _HINT,
        )
    if near.height_mm.min() > 0.15 * radius_mm:
        raise AnalysisError(
            "the ramp ends before opposite walls touch: they are still "
            f"{2 * near.height_mm.min():.1f} mm apart",
            _HINT,
        )
    found, covariance = drawn.polynomial(drawn.height_mm, 2)
    return Estimate.of(found[0], np.sqrt(covariance[0, 0])), float(found[1])


def _buckling(curve: _Curve, radius_mm: float) -> Estimate:
    """Meeting of two lines: of the open wall, and along the steepest fall."""
    least = int(np.argmin(np.abs(curve.kpa)))
    roughly_mm = curve.height_mm[least] - curve.height_mm
    low, high = (share * radius_mm for share in _BEND)
    bending = (roughly_mm > low) & (roughly_mm < high)
    if bending.sum() < 5:
        raise AnalysisError(
            f"the buckling of the liner cannot be read: {bending.sum()} levels show its wall {low:.1f} to "
            f"{high:.1f} mm in, 5 are needed",
            _HINT,
        )
    is_open = (np.abs(roughly_mm) < low / 2) & (curve.kpa <= _OPEN_SHARE * curve.kpa[bending].min())
    height_mm, slope = _line(curve.only(is_open))
    part = curve.only(bending)
    fallen_mm = height_mm + slope * part.kpa - part.height_mm
    found, covariance = part.polynomial(fallen_mm, 3)

    # The tangent at its steepest place meets the open wall's line, where nothing has fallen.
    steepest_mm = _STEEPEST * radius_mm
    by_terms = np.array([1.0, 0.0, -(steepest_mm**2), -2 * steepest_mm**3])
    return Estimate.of(float(by_terms @ found), np.sqrt(by_terms @ covariance @ by_terms))


def _line(curve: _Curve) -> tuple[float, float]:
    """Height without pressure difference, and its slope, of the open wall."""
    if len(curve.kpa) < 2 or np.ptp(curve.kpa) == 0:
        raise AnalysisError("the ramp has fewer than two levels of the open liner", _HINT)
    slope, height_mm = np.polyfit(curve.kpa, curve.height_mm, 1, w=1 / curve.sigma_mm)
    return float(height_mm), float(slope)
