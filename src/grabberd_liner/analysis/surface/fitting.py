"""Fit of a surface to a field's points: screening for impossible positions (ids that jumped, crossed
targets, a folded wall), then linear least squares on the modes of the prior.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.surface.sections import supported_places
from grabberd_liner.analysis.surface.smoothing import (
    FREE,
    Departures,
    Domain,
    Modes,
    Smoothing,
    choose,
    modes,
)
from grabberd_liner.analysis.surface.surface import Surface


class Posterior(NamedTuple):
    """The posterior of the modes' coefficients.

    Attributes:
        coefficients: (D, R), at unit amplitude; `factor`: (D, R, D·R) square root of their covariance.
        outlying: (N,) squared distance of each point from its prediction by all others, in units of its
            covariance: χ² with D degrees of freedom.
        misfit: weighted squared residuals and roughness over their expectation, which is 1.
    """

    coefficients: Array
    factor: Array
    outlying: Array
    misfit: float


def fit_modes(
    modes: Modes,
    smoothing: Smoothing,
    u_mm: Array,
    v_mm: Array,
    departure_mm: Array,
    covariance_mm2: Array,
) -> Posterior:
    """Fit the modes of the departure to N points.

    Args:
        modes: R modes, for the smoothing's lengths.
        smoothing: amplitudes of the D directions.
        u_mm: (N,) material coordinates.
        v_mm: (N,) material coordinates.
        departure_mm: (N, D) departures from the nominal shape.
        covariance_mm2: (N, D, D) noise.
    """
    places = modes.jets(u_mm, v_mm, highest=0)[:, 0]
    weight = np.linalg.inv(covariance_mm2).astype(np.float64, copy=False)
    scale = _scale(modes, smoothing)
    normal = _normal(places, weight, scale)
    right = scale * (places.T @ np.einsum("nab,nb->na", weight, departure_mm)).T
    size = right.size
    # LAPACK's Cholesky and triangular inverse: the inverse factor is needed in any case, as the root of the
    # covariance, and solves the equations on the way.
    lower = dpotrf(normal.reshape(size, size), lower=1, overwrite_a=1)[0]
    inverse = dtrtri(lower, lower=1)[0]
    factor = np.tril(inverse).T
    solved = (factor @ (factor.T @ right.ravel())).reshape(right.shape)
    factor = factor.reshape(*right.shape, size) * scale[:, :, np.newaxis]
    coefficients = scale * solved
    residual = departure_mm - places @ coefficients.T
    outlying = _outlying(places, factor, weight, residual)
    squares = float(np.einsum("na,nab,nb->", residual, weight, residual) + (solved[:, FREE:] ** 2).sum())
    return Posterior(coefficients, factor, outlying, squares / (residual.size - FREE * residual.shape[1]))


def _scale(modes: Modes, smoothing: Smoothing) -> Array:
    """(D, R): each direction's amplitude; 1 for the free modes."""
    scale = np.repeat(np.array(smoothing.amplitude_mm)[:, np.newaxis], modes.size, axis=1)
    scale[:, :FREE] = 1.0
    return scale


def _normal(places: Array, weight: Array, scale: Array) -> Array:
    """(D, R, D, R) matrix of the normal equations, including the prior's unit weights."""
    directions, size = scale.shape
    normal = np.empty((directions, size, directions, size))
    for a in range(directions):
        for b in range(a + 1):
            block = (places * weight[:, a, b, np.newaxis]).T @ places
            block *= np.multiply.outer(scale[a], scale[b])
            normal[a, :, b] = block
            normal[b, :, a] = block.T
        normal[a, np.arange(size), a, np.arange(size)] += 1.0
    return normal


def _outlying(
    places: Array,
    factor: Array,
    weight: Array,
    residual: Array,
) -> Array:
    """Leave-one-out χ² of every point, in closed form instead of N fits."""
    root = np.einsum("nr,ark->nak", places, factor, optimize=True)
    known = root @ root.transpose(0, 2, 1)
    kept = weight - weight @ known @ weight
    pull = np.einsum("nab,nb->na", weight, residual)
    return np.einsum("na,na->n", pull, np.linalg.solve(kept, pull[..., np.newaxis])[..., 0])


_SHORTEST, _LONGEST = 0.7, 1.35
"""Fibres stretch by some ten per cent; when an id jumps to a neighbour, distances double or vanish."""

# Neighbouring normals more than a right angle apart.
_STEEPEST = 0.0


class Screening(NamedTuple):
    """Result of comparing points with their neighbours.

    Attributes:
        kept: (N,) True for points at possible distances from their neighbours.
        problems: one sentence for each kind of problem, with the targets.
    """

    kept: Mask
    problems: tuple[str, ...]


def screen(grid: Grid, place: Indices, xyz_mm: Array) -> Screening:
    """Leaves out points at impossible distances from their neighbours, the worst first; reports folds.

    Args:
        grid: the target grid.
        place: (N,) indices of the points in the grid.
        xyz_mm: (N, 3) points, object's frame.
    """
    where = np.full((len(grid), 3), np.nan)
    where[place] = xyz_mm
    pairs = grid.pairs()
    nominal_mm = _lengths(grid.nominal_mm, pairs)
    left_out: list[int] = []
    while (worst := _worst(where, pairs, nominal_mm)) is not None:
        left_out.append(worst)
        where[worst] = np.nan
    kept = np.isfinite(where[place, 0])
    return Screening(kept, (*_jumped(grid, left_out), *_folded(grid, where)))


def _worst(where: Array, pairs: Indices, nominal_mm: Array) -> int | None:
    """The target with most impossible distances, by their size if several have as many; None without any."""
    ratio = _lengths(where, pairs) / nominal_mm
    wrong = (ratio < _SHORTEST) | (ratio > _LONGEST)
    if not wrong.any():
        return None
    # The number of wrong distances decides; their size, scaled far below one, only breaks ties.
    at_odds = np.where(wrong, 1 + np.minimum(np.abs(np.log(np.maximum(ratio, 1e-3))), 100) / 1e3, 0.0)
    score = np.bincount(pairs.ravel(), np.repeat(at_odds, 2), len(where))
    return int(np.argmax(score))


def _lengths(xyz: Array, pairs: Indices) -> Array:
    return np.linalg.norm(xyz[pairs[:, 1]] - xyz[pairs[:, 0]], axis=1)


def _jumped(grid: Grid, left_out: list[int]) -> tuple[str, ...]:
    if not left_out:
        return ()
    names = ", ".join(str(grid.target[index]) for index in sorted(left_out))
    return (
        f"left out, too far from or too near to their neighbours (ids jumped or crossed): targets {names}",
    )


def _folded(grid: Grid, where: Array) -> tuple[str, ...]:
    """Neighbouring triangles whose outsides face each other: the wall would be folded between them."""
    corner = where[grid.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    adjoining = grid.adjoining_triangles()
    facing = (normal[adjoining[:, 0]] * normal[adjoining[:, 1]]).sum(axis=1)
    folded = adjoining[facing < _STEEPEST]
    if not len(folded):
        return ()
    names = ", ".join(map(str, grid.target[np.unique(grid.triangles[folded])]))
    return (f"the wall is folded, or targets have crossed, among targets {names}",)


OUTLYING = 60.0
"""Limit on χ² of three degrees of freedom that chance does not reach in ten thousand captures."""

# More contradictions than that come from a wrong object model or calibration, not from single points.
LARGEST_SHARE_OUT = 0.2
_LEAST_POINTS = 3 * FREE
_MOST_FIELDS = 4


def fit_surface(grid: Grid, points: Points, smoothing: Smoothing | None = None) -> Surface:
    """The surface of one field's points.

    The prior bridges missing targets, which shows in σ and in `Surface.within`. Points at impossible
    distances from their neighbours, or many σ from the prediction by all others, are left out and named in
    `Surface.problems`.

    Args:
        grid: the object model's target grid.
        points: points of one field, with their noise (`covariance_mm2`).
        smoothing: result of `choose_smoothing` for the fields of the capture or of a phase; by default chosen
            from this field alone.

    Raises:
        AnalysisError: too few points for a surface, more than a fifth of them contradict the others, or
            points without covariance or of targets unknown to the grid.
    """
    field = _screened(grid, points)
    shape = _shape(grid)
    chosen = smoothing or choose(Domain.of(grid), [_departures(field)])
    field, posterior, left_out = _without_outliers(grid, field, chosen)
    problems = (*field.problems, *left_out_problems(grid, left_out))
    _check_share(len(points), len(points) - len(field.place), problems)
    return Surface(
        base=shape.jets,
        modes=_modes(grid, chosen),
        coefficients=posterior.coefficients,
        factor=posterior.factor,
        smoothing=chosen,
        supported=supported_places(grid, field.place),
        outward=grid.outward,
        misfit=posterior.misfit,
        problems=problems,
    )


def choose_smoothing(grid: Grid, fields: Sequence[Points], along_mm: float | None = None) -> Smoothing:
    """A common smoothing for fields of similar shape: those of a capture or of one phase.

    Of many fields, four evenly spread ones are used. If the phases of the movement differ much in shape, a
    choice for each phase gives a better σ.

    Args:
        grid: the object model's target grid.
        fields: the points of one or more fields.
        along_mm: correlation length along the rows, if known; only amplitudes are then chosen.

    Raises:
        AnalysisError: no field has enough points for a surface.
    """
    enough = [points for points in fields if len(points) >= _LEAST_POINTS]
    if not enough:
        raise AnalysisError(
            f"none of {len(fields)} fields has {_LEAST_POINTS} points, the least that a surface needs",
            "look at the capture: are the targets visible in both views?",
        )
    spread = np.unique(np.linspace(0, len(enough) - 1, _MOST_FIELDS).round().astype(int))
    departures = [_departures(_screened(grid, enough[index])) for index in spread]
    return choose(Domain.of(grid), departures, along_mm)


def possible(grid: Grid, points: Points) -> tuple[Points, tuple[str, ...]]:
    """The points at possible distances from their neighbours, and what is to be said of the others.

    Raises:
        AnalysisError: as in `fit_surface`.
    """
    field = _screened(grid, points)
    kept = np.isin(grid.indices(points.target), field.place)
    return points.select(kept), field.problems


class _Field(NamedTuple):
    """Points that take part: indices in the grid, material places, departure and covariance."""

    place: Indices
    u_mm: Array
    v_mm: Array
    departure_mm: Array
    covariance_mm2: Array
    problems: tuple[str, ...]

    def select(self, kept: Mask) -> "_Field":
        return _Field(
            self.place[kept],
            self.u_mm[kept],
            self.v_mm[kept],
            self.departure_mm[kept],
            self.covariance_mm2[kept],
            self.problems,
        )


def _screened(grid: Grid, points: Points) -> _Field:
    place = grid.indices(points.target)
    _check_covariance(points)
    kept, problems = screen(grid, place, points.xyz_mm)
    departure = points.xyz_mm - _nominal(grid)[place]
    field = _Field(place, grid.u_mm[place], grid.v_mm[place], departure, points.covariance_mm2, problems)
    field = field.select(kept)
    _check_share(len(points), int((~kept).sum()), problems)
    _check_enough(grid, field)
    return field


def _check_covariance(points: Points) -> None:
    finite = np.isfinite(points.xyz_mm).all() and np.isfinite(points.covariance_mm2).all()
    diagonal = np.einsum("naa->na", points.covariance_mm2)
    if not finite or (diagonal <= 0).any():
        raise AnalysisError(
            "points without a covariance or with values that are not finite: the fit cannot be weighted",
            "re-measure the capture; its points then have their covariance",
        )


def _check_share(count: int, left_out: int, problems: Sequence[str]) -> None:
    if left_out > LARGEST_SHARE_OUT * count:
        raise AnalysisError(
            f"{left_out} of {count} points contradict the others: {'; '.join(problems)}",
            "ids have jumped, or object model or calibration belong to another capture: re-measure it",
        )


def _check_enough(grid: Grid, field: _Field) -> None:
    rows, columns = len(np.unique(grid.row[field.place])), len(np.unique(grid.column[field.place]))
    if len(field.place) < _LEAST_POINTS or min(rows, columns) < 3:
        raise AnalysisError(
            f"{len(field.place)} points in {rows} rows and {columns} columns are too few for a surface",
            f"a field needs {_LEAST_POINTS} points, in three rows and three columns at the least",
        )


def _without_outliers(grid: Grid, field: _Field, smoothing: Smoothing) -> tuple[_Field, Posterior, list[int]]:
    """Leaves out the worst point and fits again, until no point is worse than chance allows."""
    candidate, left_out = _modes(grid, smoothing), list[int]()
    most = LARGEST_SHARE_OUT * len(field.place)
    while True:
        posterior = fit_modes(
            candidate, smoothing, field.u_mm, field.v_mm, field.departure_mm, field.covariance_mm2
        )
        worst = int(np.argmax(posterior.outlying))
        if posterior.outlying[worst] < OUTLYING or len(left_out) > most:
            return field, posterior, left_out
        left_out.append(int(field.place[worst]))
        field = field.select(np.arange(len(field.place)) != worst)


def left_out_problems(grid: Grid, left_out: Sequence[int]) -> tuple[str, ...]:
    """Sentence about targets (indices in the grid) that the others contradict; none without any."""
    if not left_out:
        return ()
    names = ", ".join(str(grid.target[index]) for index in sorted(left_out))
    return (f"left out, many σ from the prediction by the other points: targets {names}",)


def _departures(field: _Field) -> Departures:
    sigma = np.sqrt(np.einsum("naa->na", field.covariance_mm2))
    return Departures(field.u_mm, field.v_mm, field.departure_mm, sigma)


def _modes(grid: Grid, smoothing: Smoothing) -> Modes:
    return modes(Domain.of(grid), smoothing.along_mm, smoothing.round_mm)


@lru_cache(maxsize=8)
def _shape(grid: Grid) -> NominalShape:
    return NominalShape.of(grid)


@lru_cache(maxsize=8)
def _nominal(grid: Grid) -> Array:
    """(N, 3) the nominal shape at the targets."""
    return _shape(grid).jets(grid.u_mm, grid.v_mm)[:, 0]
