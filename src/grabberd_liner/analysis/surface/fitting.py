"""Fit of a surface to a field's points."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.face import supported_places
from grabberd_liner.analysis.surface.modes import FREE, Domain, Modes, modes
from grabberd_liner.analysis.surface.nominal_shape import NominalShape
from grabberd_liner.analysis.surface.posterior import Posterior, fit_modes
from grabberd_liner.analysis.surface.screening import screen
from grabberd_liner.analysis.surface.smoothing import Criterion, Departures, Smoothing, choose
from grabberd_liner.analysis.surface.surface import Surface

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
    chosen = smoothing or choose(_domain(grid), [_departures(field)])
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


def choose_smoothing(
    grid: Grid, fields: Sequence[Points], by: Criterion = "likelihood", along_mm: float | None = None
) -> Smoothing:
    """A common smoothing for fields of similar shape: those of a capture or of one phase.

    Of many fields, four evenly spread ones are used. If the phases of the movement differ much in shape, a
    choice for each phase gives a better σ.

    Args:
        grid: the object model's target grid.
        fields: the points of one or more fields.
        by: "likelihood" takes the points' σ as known; "cross-validation" uses only their ratios and estimates
            their common factor.
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
    return choose(_domain(grid), departures, by, along_mm)


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

    place: NDArray[np.intp]
    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    departure_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float64]
    problems: tuple[str, ...]

    def select(self, kept: NDArray[np.bool_]) -> "_Field":
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
    return modes(_domain(grid), smoothing.along_mm, smoothing.round_mm)


def _domain(grid: Grid) -> Domain:
    rows, columns = int(grid.row.max()) + 1, int(grid.column.max()) + 1
    return Domain(0.0, 0.0, grid.u_pitch_mm, grid.v_pitch_mm, rows, columns)


@lru_cache(maxsize=8)
def _shape(grid: Grid) -> NominalShape:
    return NominalShape.of(grid)


@lru_cache(maxsize=8)
def _nominal(grid: Grid) -> NDArray[np.float64]:
    """(N, 3) the nominal shape at the targets."""
    return _shape(grid).jets(grid.u_mm, grid.v_mm)[:, 0]
