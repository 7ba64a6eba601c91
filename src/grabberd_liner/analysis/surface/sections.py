"""Sections of the wall at given heights: outline, width, area; the volume between two of them.

The cameras see the wall from one side. Unless the targets go all the way round, the opposite wall is not
measured: width, area and volume are then relative to a given plane, such as the plane of symmetry between
both walls (`symmetry_plane` is the nominal one). Everything refers to the outer (target) face. An outline is
(M, 3) points at one height x, evenly spaced in v; x is given, so that nothing is derived by it.

Outer face of the wall as sections and volumes need it, where data support it, and the area that the
targets cover.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.surface.jets import index
from grabberd_liner.analysis.surface.smoothing import Domain
from grabberd_liner.analysis.wall.splines import gauss_rule

_REACH = 0.5 + 1e-9
"""Half a pitch; the slack keeps positions halfway between two targets within both."""


class Face(Protocol):
    """The outer (target) face of the wall over material coordinates u, v, at one field."""

    @property
    def domain(self) -> Domain:
        """The grid of targets."""

    @property
    def misfit(self) -> float:
        """Weighted squared departure of the points over its expectation: 1 if the points' σ are right."""

    @property
    def problems(self) -> tuple[str, ...]:
        """Points left out and the reasons, as sentences."""

    def within(self, u_mm: Array, v_mm: Array) -> Mask:
        """(N,) True for positions supported by data."""

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X."""

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""


def supported_places(grid: Grid, seen: Indices) -> Mask:
    """(rows, columns): True for targets that are seen, or the only missing one among their neighbours."""
    there = np.zeros(len(grid), bool)
    there[seen] = True
    alone = np.ones(len(grid), bool)
    first, second = grid.pairs().T
    np.logical_and.at(alone, first, there[second])
    np.logical_and.at(alone, second, there[first])
    supported = np.zeros((grid.row.max() + 1, grid.column.max() + 1), bool)
    supported[grid.row, grid.column] = there | alone
    return supported


def is_within(domain: Domain, supported: Mask, u_mm: Array, v_mm: Array) -> Mask:
    """(N,) True for positions supported by data.

    These lie within half a pitch (along and round) of a target that was seen, or whose neighbours were
    all seen; not farther outside, nor in a hole of several targets.
    """
    row, column = (u_mm - domain.u_mm) / domain.u_pitch_mm, (v_mm - domain.v_mm) / domain.v_pitch_mm
    near_row = np.clip(np.round(row), 0, domain.rows - 1).astype(np.intp)
    near_column = np.clip(np.round(column), 0, domain.columns - 1).astype(np.intp)
    near = (np.abs(row - near_row) <= _REACH) & (np.abs(column - near_column) <= _REACH)
    return near & supported[near_row, near_column]


# Gauss' rule with two nodes is exact for cubics; half a cell of the wall is hardly more curved than that.
_NODES = 2


class Area(NamedTuple):
    """The wall's outer face between its outermost targets.

    Attributes:
        area_mm2: area supported by data, with σ from the points' noise and the smoothing.
        covered: share of the target grid supported by data; the rest is left out.
    """

    area_mm2: Estimate
    covered: float


def surface_area(surface: Face) -> Area:
    """The area, by Gauss' rule in every half cell of the target grid."""
    domain = surface.domain
    u_mm, u_share = _nodes(domain.u_mm, domain.u_pitch_mm, domain.rows)
    v_mm, v_share = _nodes(domain.v_mm, domain.v_pitch_mm, domain.columns)
    u, v = np.repeat(u_mm, len(v_mm)), np.tile(v_mm, len(u_mm))
    share = np.multiply.outer(u_share, v_share).ravel()
    kept = np.where(surface.within(u, v), share, 0.0)
    jets = surface.tangents(u, v)
    slopes = kept[:, np.newaxis, np.newaxis] * _slopes(jets)
    variance = surface.covariance(slopes[np.newaxis], u, v)[0, 0]
    value = (kept * np.linalg.norm(_normal(jets), axis=1)).sum()
    return Area(Estimate.of(value, np.sqrt(variance)), float(kept.sum() / share.sum()))


def _nodes(start: float, pitch: float, knots: int) -> tuple[Array, Array]:
    node, weight = gauss_rule(_NODES)
    half = pitch / 2
    starts = start + half * np.arange(2 * (knots - 1))
    return (starts[:, np.newaxis] + half * (node + 1) / 2).ravel(), np.tile(half / 2 * weight, len(starts))


def _normal(jets: Array) -> Array:
    return np.cross(jets[:, index(1, 0)], jets[:, index(0, 1)])


def _slopes(jets: Array) -> Array:
    """(N, 3, 3) derivatives of |X_u × X_v| by X, X_u, X_v."""
    normal = _normal(jets)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along, across = jets[:, index(1, 0)], jets[:, index(0, 1)]
    return np.stack([np.zeros_like(unit), np.cross(across, unit), np.cross(unit, along)], axis=1)


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
    return ((away[..., 1:] + away[..., :-1]) / 2 * np.diff(beside, axis=-1)).sum(axis=-1)


def _trapezia_slopes(away: Array, beside: Array, normal: Array, across: Array) -> Array:
    half_step, half_sum = np.diff(beside, axis=-1) / 2, (away[..., 1:] + away[..., :-1]) / 2
    by_away, by_beside = np.zeros_like(away), np.zeros_like(away)
    by_away[..., 1:] += half_step
    by_away[..., :-1] += half_step
    by_beside[..., 1:] += half_sum
    by_beside[..., :-1] -= half_sum
    return np.multiply.outer(by_away, normal) + np.multiply.outer(by_beside, across)


_NEWTON_STEPS = 6
_STRAIGHT_MM = 0.01
_HINT = "choose heights between the first and the last row of targets"


class Section(NamedTuple):
    """The wall where it crosses the plane x = `x_mm`, from its first column of targets to its last.

    Attributes:
        x_mm: height in the object's frame.
        outline_mm: (M, 3) points, evenly spaced in v; `v_mm`: (M,) their v.
        within: (M,) True for points supported by data.
        length_mm: length along the outline; `chord_mm`: distance of its ends.
        distance_mm: distance from the given plane to the outline, on the normal through the plane's point;
            half the distance of opposite walls if the plane is their plane of symmetry. NaN if there is no
            wall on that normal, None without a plane.
        area_mm2: area between outline and given plane; None without a plane.
        least_width_mm: least distance of two parallel lines that enclose the outline; `opposite_mm`: least
            distance of two points half a turn apart. None unless the targets go all the way round; the gap
            between the last column and the first counts as straight.
    """

    x_mm: float
    outline_mm: Array
    v_mm: Array
    within: Mask
    length_mm: Estimate
    chord_mm: Estimate
    distance_mm: Estimate | None
    area_mm2: Estimate | None
    least_width_mm: Estimate | None
    opposite_mm: Estimate | None


def symmetry_plane(grid: Grid) -> Plane:
    """The nominal tube's plane of symmetry: through its axis, across the middle of the targets.

    Raises:
        AnalysisError: the object model is no tube.
    """
    shape = NominalShape.of(grid)
    if not shape.radius_mm:
        raise AnalysisError(
            "the object model's targets do not lie on a tube: it has no axis of symmetry",
            "give the plane between the walls as a point and a normal",
        )
    outward = grid.nominal_mm.mean(axis=0) - shape.origin_mm
    along = shape.along / np.linalg.norm(shape.along)
    return Plane(shape.origin_mm, outward - (outward @ along) * along)


def sections(
    surface: Face, x_mm: Sequence[float], plane: Plane | None = None
) -> tuple[tuple[Section, ...], tuple[str, ...]]:
    """The sections at all heights that the wall reaches, and a sentence for each of the other heights."""
    if not len(x_mm):
        return (), ()
    cuts = _cuts(surface, np.array(x_mm, np.float64))
    measured = [_measured(surface, cut, plane) if cut.reached else {} for cut in cuts.each()]
    estimates = _estimates(surface, cuts, measured)
    found = tuple(
        _section(surface, cut, each) for cut, each in zip(cuts.each(), estimates, strict=True) if cut.reached
    )
    return found, tuple(_missed(x) for x in cuts.x_mm[~cuts.reached])


def _measured(surface: Face, cut: "_Cuts", plane: Plane | None) -> dict[str, Measured]:
    measured = {"length_mm": length(cut.outline_mm), "chord_mm": chord(cut.outline_mm)}
    if plane is not None:
        measured |= {
            "distance_mm": distance_to(plane, cut.outline_mm),
            "area_mm2": area_to(plane, cut.outline_mm),
        }
    # Ends within one and a half pitches of each other: the targets go all the way round.
    if measured["chord_mm"].value < 1.5 * surface.domain.v_pitch_mm:
        measured |= {"least_width_mm": least_width(cut.outline_mm), "opposite_mm": opposite(cut.outline_mm)}
    return measured


def _section(surface: Face, cut: "_Cuts", estimates: dict[str, Estimate]) -> Section:
    values = dict.fromkeys(("distance_mm", "area_mm2", "least_width_mm", "opposite_mm")) | estimates
    within = surface.within(cut.u_mm, cut.v_mm)
    return Section(float(cut.x_mm), cut.outline_mm, cut.v_mm, within, **values)  # type: ignore[arg-type]


def volume_mm3(surface: Face, x_mm: tuple[float, float], plane: Plane) -> Estimate:
    """The volume between the wall, a plane, and the sections at two heights, with σ.

    Raises:
        AnalysisError: the wall does not reach these heights.
    """
    low, high = sorted(x_mm)
    # A Gauss node per row of targets, which is as fine as the surface can vary, and a few more.
    count = 4 + round((high - low) / surface.domain.u_pitch_mm)
    nodes, weights = gauss_rule(count)
    cuts = _cuts(surface, (low + high) / 2 + (high - low) / 2 * nodes)
    if not cuts.reached.all():
        raise AnalysisError(_missed(cuts.x_mm[~cuts.reached][0]), _HINT)
    share = (high - low) / 2 * weights
    areas = area_to(plane, cuts.outline_mm)
    slopes = _at_height(share[:, np.newaxis, np.newaxis] * areas.slopes, cuts.along)
    places = cuts.u_mm.ravel(), cuts.v_mm.ravel()
    variance = surface.covariance(slopes.reshape(1, -1, 1, 3), *places)[0, 0]
    return Estimate.of(float(share @ areas.value), np.sqrt(variance))


class _Cuts(NamedTuple):
    """Outlines at H heights: material coordinates (H, M), outlines and ∂X/∂u there (H, M, 3).

    `reached`: (H,) True for heights that the wall reaches, up to half a pitch beyond its outermost rows.
    """

    x_mm: Array
    u_mm: Array
    v_mm: Array
    outline_mm: Array
    along: Array
    reached: Mask

    def each(self) -> Iterator["_Cuts"]:
        return (_Cuts(*values) for values in zip(*self, strict=True))


def _cuts(surface: Face, x_mm: Array) -> _Cuts:
    """Newton's iteration for u at every height and v; the last step is short enough to be linear."""
    domain = surface.domain
    columns, rows = domain.columns - 1, domain.rows - 1
    v_mm = domain.v_mm + np.linspace(0, columns * domain.v_pitch_mm, columns * FINENESS + 1)
    first, last = domain.u_mm, domain.u_mm + rows * domain.u_pitch_mm
    u_mm = np.full((1, len(v_mm)), (first + last) / 2)
    for _ in range(_NEWTON_STEPS):
        round_mm = np.broadcast_to(v_mm, u_mm.shape)
        jets = surface.tangents(u_mm.ravel(), round_mm.ravel()).reshape(*u_mm.shape, 3, 3)
        along = jets[..., index(1, 0), :]
        short = (x_mm[:, np.newaxis] - jets[..., 0, 0]) / along[..., 0]
        if np.abs(short).max() < _STRAIGHT_MM:
            break
        # Beyond a pitch outside the targets the spline is meaningless, and Newton's method might not return.
        u_mm = np.clip(u_mm + short, first - domain.u_pitch_mm, last + domain.u_pitch_mm)
    u_mm, v_mm, along = (
        np.broadcast_to(each, (len(x_mm), *each.shape[1:])) for each in (u_mm, round_mm, along)
    )
    reach = 0.5 * domain.u_pitch_mm
    reached = np.asarray(((u_mm >= first - reach) & (u_mm <= last + reach)).all(axis=1))
    return _Cuts(x_mm, u_mm, v_mm, jets[..., 0, :] + short[..., np.newaxis] * along, along, reached)


def _missed(x_mm: float) -> str:
    return f"there is no section at x = {x_mm:g} mm: the targets do not reach there"


def _estimates(
    surface: Face, cuts: _Cuts, measured: Sequence[dict[str, Measured]]
) -> list[dict[str, Estimate]]:
    """Give σ to the measures at all heights at once, which asks for the same places only once."""
    heights, places = cuts.u_mm.shape
    owner = [height for height, each in enumerate(measured) for _ in each]
    slopes = np.zeros((len(owner), heights, places, 1, 3))
    for row, (height, one) in enumerate(zip(owner, _all(measured), strict=True)):
        slopes[row, height, :, 0] = _at_height(one.slopes, cuts.along[height])
    if not owner:
        return [{} for _ in measured]
    flat = slopes.reshape(len(owner), heights * places, 1, 3)
    sigma = iter(np.sqrt(np.diag(surface.covariance(flat, cuts.u_mm.ravel(), cuts.v_mm.ravel()))))
    return [{name: Estimate(one.value, next(sigma)) for name, one in each.items()} for each in measured]


def _all(measured: Sequence[dict[str, Measured]]) -> Iterator[Measured]:
    for each in measured:
        yield from each.values()


def _at_height(slopes: Array, along: Array) -> Array:
    """(..., 3) derivatives by the surface's points, from those by the outline's points.

    The outline stays at its height: a point that moves along x is replaced by its neighbour along the wall.
    """
    off = -(slopes[..., 1:] * along[..., 1:]).sum(axis=-1, keepdims=True) / along[..., :1]
    return np.concatenate([off, slopes[..., 1:]], axis=-1)
