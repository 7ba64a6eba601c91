"""Measures of a section's outline, each with its derivatives by the outline's positions.

An outline is (M, 3) points at one height x, evenly spaced in v; x is given: there are no derivatives by it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FINENESS = 8
"""Points from one column of targets to the next; even, so that every second one makes a coarser outline."""

# Steps of one degree: a width is stationary at its least, so the error is of second order.
_DIRECTIONS = 180
_ACROSS = np.array([0.0, 1.0, 1.0])


class Plane(NamedTuple):
    """A plane in the object's frame, mm; `normal`: (3,) towards the seen wall, of any length."""

    point_mm: Array
    normal: Array


class Measured(NamedTuple):
    """A value, and its derivatives (M, 3) by the outline's points."""

    value: Array
    slopes: Array


def length(outline_mm: Array) -> Measured:
    """Length of the outline: that of its polygon, whose error is quadratic in the step, by Richardson
    extrapolation.
    """
    fine, coarse = _polygon(outline_mm), _polygon(outline_mm[::2])
    slopes = 4 / 3 * fine.slopes
    slopes[::2] -= coarse.slopes / 3
    return Measured((4 * fine.value - coarse.value) / 3, slopes)


def chord(outline_mm: Array) -> Measured:
    """Distance between the ends."""
    return _between(outline_mm, 0, len(outline_mm) - 1)


def distance_to(plane: Plane, outline_mm: Array) -> Measured:
    """Distance along the normal through the plane's point, by a parabola through three points."""
    normal, across = _axes(plane)
    away, beside = (outline_mm - plane.point_mm) @ normal, (outline_mm - plane.point_mm) @ across
    middle = int(np.clip(np.argmin(np.abs(beside)), 1, len(away) - 2))
    nearest = slice(middle - 1, middle + 2)
    weight, steepness = _parabola(beside[nearest], away[nearest])
    slopes = np.zeros_like(outline_mm)
    slopes[nearest] = _ACROSS * (
        np.multiply.outer(weight, normal) - np.multiply.outer(weight * steepness, across)
    )
    # The normal misses the outline: a parabola would extrapolate a wall where there is none.
    if not beside.min() <= 0 <= beside.max():
        return Measured(np.asarray(np.nan), np.full_like(slopes, np.nan))
    return Measured(np.asarray(weight @ away[nearest]), slopes)


def area_to(plane: Plane, outlines_mm: Array) -> Measured:
    """Area between outline and plane, for any number of outlines (..., M, 3), by Simpson's rule."""
    normal, across = _axes(plane)
    away, beside = (outlines_mm - plane.point_mm) @ normal, outlines_mm @ across
    way = np.sign(beside[..., -1] - beside[..., 0])
    value = (4 * _trapezia(away, beside) - _trapezia(away[..., ::2], beside[..., ::2])) / 3
    slopes = 4 / 3 * _trapezia_slopes(away, beside, normal, across)
    slopes[..., ::2, :] -= _trapezia_slopes(away[..., ::2], beside[..., ::2], normal, across) / 3
    return Measured(way * value, _ACROSS * way[..., np.newaxis, np.newaxis] * slopes)


def least_width(outline_mm: Array) -> Measured:
    """Least distance of two parallel lines that enclose the outline."""
    turn = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    direction = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    reach = outline_mm[:, 1:] @ direction.T
    least = int(np.argmin(np.ptp(reach, axis=0)))
    slopes = np.zeros_like(outline_mm)
    slopes[np.argmax(reach[:, least]), 1:] += direction[least]
    slopes[np.argmin(reach[:, least]), 1:] -= direction[least]
    return Measured(np.asarray(np.ptp(reach[:, least])), slopes)


def opposite(outline_mm: Array) -> Measured:
    """Least distance of two points half a turn apart."""
    half = (len(outline_mm) + FINENESS) // 2
    away = np.linalg.norm(outline_mm[half:] - outline_mm[: len(outline_mm) - half], axis=1)
    least = int(np.argmin(away))
    return _between(outline_mm, least, least + half)


def _parabola(place: Array, height: Array) -> tuple[Array, Array]:
    """(3,) weights of three heights in their parabola's value at 0, and the parabola's slope at each."""
    a, b, c = place
    weight = np.array([b * c / ((b - a) * (c - a)), a * c / ((a - b) * (c - b)), a * b / ((a - c) * (b - c))])
    first, second = np.diff(height) / np.diff(place)
    return weight, first + (second - first) / (c - a) * (2 * place - a - b)


def _polygon(outline_mm: Array) -> Measured:
    sides = np.diff(outline_mm, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    unit = sides / lengths[:, np.newaxis]
    slopes = np.zeros_like(outline_mm)
    slopes[1:] += unit
    slopes[:-1] -= unit
    return Measured(lengths.sum(), _ACROSS * slopes)


def _between(outline_mm: Array, first: int, second: int) -> Measured:
    side = outline_mm[second] - outline_mm[first]
    value, slopes = np.linalg.norm(side), np.zeros_like(outline_mm)
    slopes[second], slopes[first] = _ACROSS * side / value, -_ACROSS * side / value
    return Measured(np.asarray(value), slopes)


def _axes(plane: Plane) -> tuple[Array, Array]:
    """The plane's unit normal, and the direction across it in the section."""
    normal = plane.normal / np.linalg.norm(plane.normal)
    return normal, np.array([0.0, -normal[2], normal[1]])


def _trapezia(away: Array, beside: Array) -> Array:
    area: Array = ((away[..., 1:] + away[..., :-1]) / 2 * np.diff(beside, axis=-1)).sum(axis=-1)
    return area


def _trapezia_slopes(away: Array, beside: Array, normal: Array, across: Array) -> Array:
    half_step, half_sum = np.diff(beside, axis=-1) / 2, (away[..., 1:] + away[..., :-1]) / 2
    by_away, by_beside = np.zeros_like(away), np.zeros_like(away)
    by_away[..., 1:] += half_step
    by_away[..., :-1] += half_step
    by_beside[..., 1:] += half_sum
    by_beside[..., :-1] -= half_sum
    slopes: Array = np.multiply.outer(by_away, normal) + np.multiply.outer(by_beside, across)
    return slopes
