"""Sections of the wall at given heights: outline, width, area; the volume between two of them.

The cameras see the wall from one side. Where the targets do not go round, the opposite wall is not measured:
width, area and volume are then those between the seen wall and a plane that is given, such as the plane of
symmetry between both walls (`symmetry_plane` has the nominal one). All is about the outer (target) face.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.grid import Grid
from grabberd.analysis.jets import index
from grabberd.analysis.nominal_shape import NominalShape
from grabberd.analysis.surface import Surface
from grabberd.errors import AnalysisError

_FINENESS = 8
_NEWTON_STEPS = 6
_STRAIGHT_MM = 0.01
_STEP_MM = 1e-4
_DIRECTIONS = 180

Measure = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Plane(NamedTuple):
    """A plane in the object's frame, mm; `normal`: (3,) towards the seen wall, of any length."""

    point_mm: NDArray[np.float64]
    normal: NDArray[np.float64]


class Section(NamedTuple):
    """The wall where it crosses the plane x = `x_mm`, from its first column of targets to its last.

    Attributes:
        x_mm: height in the object's frame.
        outline_mm: (M, 3) places, evenly spaced in v; `v_mm`: (M,) which.
        within: (M,) whether data support them.
        length_mm: along the outline; `chord_mm`: between its ends.
        distance_mm: from the given plane to the outline, on the normal through the plane's point; twice it is
            the distance between opposite walls where the plane is that of their symmetry. NaN where no wall
            is there, None without a plane.
        area_mm2: between outline and given plane. None without a plane.
        least_width_mm: least distance of two parallel lines that hold the whole outline between them;
            `opposite_mm`: least distance of two places half the round apart. None where the targets do not
            go round; the gap between the last column and the first counts as straight.
    """

    x_mm: float
    outline_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    within: NDArray[np.bool_]
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


def section(surface: Surface, x_mm: float, plane: Plane | None = None) -> Section:
    """The section at one height, each value with σ from the points' noise and the smoothing.

    Args:
        surface: of one field.
        x_mm: height in the object's frame.
        plane: what widths and areas are taken from, where the targets do not go round.

    Raises:
        AnalysisError: the wall does not reach this height between its first and last row of targets.
    """
    cut = _cuts(surface, np.array([x_mm])).one(0)
    measures: dict[str, Measure] = {"length_mm": _length, "chord_mm": _chord}
    if plane is not None:
        measures |= {"distance_mm": _distance_to(plane), "area_mm2": _area_to(plane)}
    if _chord(cut.outline_mm) < 1.5 * surface.modes.domain.v_pitch_mm:
        measures |= {"least_width_mm": _least_width, "opposite_mm": _opposite}
    values = dict.fromkeys(("distance_mm", "area_mm2", "least_width_mm", "opposite_mm"))
    estimates = values | _estimates(surface, cut, measures)
    within = surface.within(cut.u_mm, cut.v_mm)
    return Section(x_mm, cut.outline_mm, cut.v_mm, within, **estimates)  # type: ignore[arg-type]


def volume_mm3(surface: Surface, x_mm: tuple[float, float], plane: Plane) -> Estimate:
    """The volume between the wall, a plane, and the sections at two heights, with σ.

    Raises:
        AnalysisError: the wall does not reach these heights.
    """
    low, high = sorted(x_mm)
    count = 4 + round((high - low) / surface.modes.domain.u_pitch_mm)
    nodes, weights = np.polynomial.legendre.leggauss(count)
    cuts = _cuts(surface, (low + high) / 2 + (high - low) / 2 * nodes)
    share = (high - low) / 2 * weights
    value = share @ _area_to(plane)(cuts.outline_mm)
    slopes = _at_height(share[:, np.newaxis, np.newaxis] * _area_slopes(cuts.outline_mm, plane), cuts.along)
    places = cuts.u_mm.ravel(), cuts.v_mm.ravel()
    variance = surface.covariance(slopes.reshape(1, -1, 1, 3), *places)[0, 0]
    return Estimate(np.asarray(value), np.sqrt(variance))


class _Cuts(NamedTuple):
    """Outlines at H heights: material places (H, M), the outlines and ∂X/∂u there (H, M, 3)."""

    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    outline_mm: NDArray[np.float64]
    along: NDArray[np.float64]

    def one(self, height: int) -> "_Cuts":
        return _Cuts(*(values[height] for values in self))


def _cuts(surface: Surface, x_mm: NDArray[np.float64]) -> _Cuts:
    """Newton's iterations for u at every height and v; the last step is short enough to be straight."""
    domain = surface.modes.domain
    v_mm = domain.v_mm + np.linspace(
        0, (domain.columns - 1) * domain.v_pitch_mm, (domain.columns - 1) * _FINENESS + 1
    )
    end = domain.u_mm + (domain.rows - 1) * domain.u_pitch_mm
    u_mm = np.full((1, len(v_mm)), (domain.u_mm + end) / 2)
    for _ in range(_NEWTON_STEPS):
        round_mm = np.broadcast_to(v_mm, u_mm.shape)
        jets = surface.tangents(u_mm.ravel(), round_mm.ravel()).reshape(*u_mm.shape, 3, 3)
        along = jets[..., index(1, 0), :]
        short = (x_mm[:, np.newaxis] - jets[..., 0, 0]) / along[..., 0]
        if np.abs(short).max() < _STRAIGHT_MM:
            break
        u_mm = u_mm + short
    reach = 0.5 * domain.u_pitch_mm
    lost = not np.isfinite(u_mm).all()
    for height, row in zip(x_mm, np.broadcast_to(u_mm, (len(x_mm), len(v_mm))), strict=True):
        if lost or row.min() < domain.u_mm - reach or row.max() > end + reach:
            raise AnalysisError(
                f"there is no section at x = {height:g} mm: the targets do not reach there",
                "choose heights between the first and the last row of targets",
            )
    return _Cuts(u_mm, round_mm, jets[..., 0, :] + short[..., np.newaxis] * along, along)


def _estimates(surface: Surface, cut: _Cuts, measures: dict[str, Measure]) -> dict[str, Estimate]:
    slopes = np.stack(
        [_at_height(_slopes(cut.outline_mm, measure), cut.along) for measure in measures.values()]
    )
    variance = np.diag(surface.covariance(slopes[:, :, np.newaxis], cut.u_mm, cut.v_mm))
    return {
        name: Estimate(measure(cut.outline_mm), np.sqrt(one))
        for (name, measure), one in zip(measures.items(), variance, strict=True)
    }


def _slopes(outline: NDArray[np.float64], measure: Measure) -> NDArray[np.float64]:
    """(M, 3) derivatives of a measure of the outline by its places; by x, which is given, none."""
    moved = _STEP_MM * np.eye(outline.size).reshape(*outline.shape, *outline.shape)[:, 1:]
    slopes = (measure(outline + moved) - measure(outline - moved)) / (2 * _STEP_MM)
    return np.concatenate([np.zeros((len(outline), 1)), slopes], axis=1)


def _at_height(slopes: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 3) derivatives by the surface's places, from those by the outline's.

    The outline stays at its height: a place that moves along x is replaced by its neighbour along the wall.
    """
    off = -(slopes[..., 1:] * along[..., 1:]).sum(axis=-1, keepdims=True) / along[..., :1]
    return np.concatenate([off, slopes[..., 1:]], axis=-1)


def _length(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the polygon; what it cuts off is known from every second place (Richardson)."""
    fine, coarse = (
        np.linalg.norm(np.diff(places, axis=-2), axis=-1).sum(axis=-1)
        for places in (outline, outline[..., ::2, :])
    )
    length: NDArray[np.float64] = (4 * fine - coarse) / 3
    return length


def _chord(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    chord: NDArray[np.float64] = np.linalg.norm(outline[..., -1, :] - outline[..., 0, :], axis=-1)
    return chord


def _distance_to(plane: Plane) -> Measure:
    """On the normal through the plane's point; between places by the parabola through the nearest three."""
    normal = plane.normal / np.linalg.norm(plane.normal)
    across = np.cross([1.0, 0.0, 0.0], normal)

    def measure(outline: NDArray[np.float64]) -> NDArray[np.float64]:
        away, beside = (outline - plane.point_mm) @ normal, (outline - plane.point_mm) @ across
        middle = np.clip(np.argmin(np.abs(beside), axis=-1), 1, away.shape[-1] - 2)
        nearest = middle[..., np.newaxis] + np.arange(-1, 2)
        height, place = (np.take_along_axis(values, nearest, axis=-1) for values in (away, beside))
        total = np.zeros(away.shape[:-1])
        for k in range(3):
            others = np.delete(place, k, axis=-1)
            total += height[..., k] * (others / (others - place[..., [k]])).prod(axis=-1)
        reached = (beside.min(axis=-1) <= 0) & (beside.max(axis=-1) >= 0)
        return np.where(reached, total, np.nan)

    return measure


def _area_to(plane: Plane) -> Measure:
    """The area between outline and plane: trapezia, the ends' correction by Simpson's rule."""
    normal = plane.normal / np.linalg.norm(plane.normal)
    across = np.cross([1.0, 0.0, 0.0], normal)

    def measure(outline: NDArray[np.float64]) -> NDArray[np.float64]:
        away, beside = (outline - plane.point_mm) @ normal, outline @ across
        fine = _trapezia(away, beside)
        coarse = _trapezia(away[..., ::2], beside[..., ::2])
        area: NDArray[np.float64] = (4 * fine - coarse) / 3 * np.sign(beside[..., -1] - beside[..., 0])
        return area

    return measure


def _area_slopes(outline: NDArray[np.float64], plane: Plane) -> NDArray[np.float64]:
    """(..., M, 3) derivatives of that area by the outline's places."""
    normal = plane.normal / np.linalg.norm(plane.normal)
    across = np.cross([1.0, 0.0, 0.0], normal)
    away, beside = (outline - plane.point_mm) @ normal, outline @ across
    slopes = 4 / 3 * _trapezia_slopes(away, beside, normal, across)
    slopes[..., ::2, :] -= _trapezia_slopes(away[..., ::2], beside[..., ::2], normal, across) / 3
    way: NDArray[np.float64] = np.sign(beside[..., -1] - beside[..., 0])[..., np.newaxis, np.newaxis]
    return way * slopes


def _trapezia_slopes(
    away: NDArray[np.float64],
    beside: NDArray[np.float64],
    normal: NDArray[np.float64],
    across: NDArray[np.float64],
) -> NDArray[np.float64]:
    half_step, half_sum = np.diff(beside, axis=-1) / 2, (away[..., 1:] + away[..., :-1]) / 2
    by_away, by_beside = np.zeros_like(away), np.zeros_like(away)
    by_away[..., 1:] += half_step
    by_away[..., :-1] += half_step
    by_beside[..., 1:] += half_sum
    by_beside[..., :-1] -= half_sum
    slopes: NDArray[np.float64] = np.multiply.outer(by_away, normal) + np.multiply.outer(by_beside, across)
    return slopes


def _trapezia(away: NDArray[np.float64], beside: NDArray[np.float64]) -> NDArray[np.float64]:
    area: NDArray[np.float64] = ((away[..., 1:] + away[..., :-1]) / 2 * np.diff(beside, axis=-1)).sum(axis=-1)
    return area


def _least_width(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    turn = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    width = np.ptp(outline[..., 1:] @ np.stack([np.cos(turn), np.sin(turn)]), axis=-2)
    least: NDArray[np.float64] = width.min(axis=-1)
    return least


def _opposite(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    half = (outline.shape[-2] + _FINENESS) // 2
    away = np.linalg.norm(outline[..., half:, :] - outline[..., : outline.shape[-2] - half, :], axis=-1)
    least: NDArray[np.float64] = away.min(axis=-1)
    return least
