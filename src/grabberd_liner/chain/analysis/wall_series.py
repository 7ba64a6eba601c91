"""The wall at many fields or phases, several of them at a time.

One choice of smoothing serves each part of the wall's stroke: an open wall is smoother than a closed one.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap
from grabberd_liner.analysis.load.pressure_model import PressureModel, SettledWall
from grabberd_liner.analysis.surface.face import Face, supported_places
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface, left_out_problems, possible
from grabberd_liner.analysis.surface.free_surface import fit_free_surface
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.arrays import Array
from grabberd_liner.chain.analysis.wall_state import Question, WallState, wall_states

LEVELS = 5
"""Parts of the stroke. Each ends at half the departure of the next one, since the prior's amplitude grows
with the departure: a prior that suits a nearly open wall treats the points of a moving one as outliers."""


@dataclass(frozen=True, slots=True, eq=False)
class Smoothings:
    """Smoothings by the wall's departure from its nominal shape.

    Attributes:
        grid: target grid of the object model.
        limits_mm: (L - 1,) ascending departures that separate the levels.
        choices: L smoothings with one correlation length, that of the level with the greatest departure.
    """

    grid: Grid
    limits_mm: Array
    choices: tuple[Smoothing, ...]

    @classmethod
    def of(cls, grid: Grid, fields: Sequence[Points]) -> "Smoothings":
        """Choose from the fields of a capture.

        Raises:
            AnalysisError: no field has enough points for a surface.
        """
        departures = np.array([departure_mm(grid, points) for points in fields])
        known = departures[np.isfinite(departures)]
        if not len(known):
            raise AnalysisError(f"there are no points in {len(fields)} fields", "measure the capture first")
        limits = known.max() * 0.5 ** np.arange(LEVELS - 1, 0, -1)
        level = np.searchsorted(limits, departures)
        ascending = np.argsort(departures)
        parts = [[fields[k] for k in ascending[level[ascending] == one]] for one in range(LEVELS)]
        return cls(grid, limits, _choices(grid, parts, fields))

    def for_points(self, points: Points) -> Smoothing:
        """Smoothing of one field."""
        return self.choices[int(np.searchsorted(self.limits_mm, departure_mm(self.grid, points)))]


def _choices(
    grid: Grid, parts: Sequence[Sequence[Points]], fields: Sequence[Points]
) -> tuple[Smoothing, ...]:
    """Smoothing of each part; a part without fields, or with poor ones only, takes that of the part above."""
    chosen: list[Smoothing] = []
    # The greatest departure has the most signal to show the correlation length: it is estimated there and
    # held for the flatter levels.
    for part in reversed(parts):
        above = chosen[-1] if chosen else None
        try:
            chosen.append(choose_smoothing(grid, part, along_mm=above.along_mm if above else None))
        except AnalysisError:
            chosen.append(above or choose_smoothing(grid, fields))
    return tuple(reversed(chosen))


def departure_mm(grid: Grid, points: Points) -> float:
    """Root mean square departure of the points from the nominal shape."""
    if not len(points):
        return float("nan")
    off = points.xyz_mm - grid.nominal_mm[grid.indices(points.target)]
    return float(np.sqrt((off**2).sum(axis=1).mean()))


_BATCH = 8
"""Fields evaluated in one batch; larger batches are no faster."""

Note = Callable[[str, Iterable[str]], None]


@dataclass(frozen=True, slots=True, eq=False)
class WallSeries:
    """Recipe for the wall states of a capture.

    Attributes:
        question: Quantities to compute for each state.
        smoothings: Smoothings by the wall's departure; None if the targets differ from field to field, in
            which case each field chooses its own.
        pressure: Model of the pressure maps; None if one of its inputs is missing.
        note: Called with the name of every state and its problems, in order, after the last one.
        progress: Called with the number of finished states and the total.
    """

    question: Question
    smoothings: Smoothings | None
    pressure: PressureModel | None
    note: Note
    progress: Callable[[int, int], None]

    def states(
        self,
        points: Sequence[Points],
        names: Sequence[str],
        vacuum: Sequence[ChamberVacuum | None],
        speed_mm_per_s: Array,
        averaged: Sequence[bool],
    ) -> list[tuple[int, WallState]]:
        """States of the points that determine a surface, with their indices in the series.

        Args:
            points: of F fields or phases.
            names: of each of them.
            vacuum: at each of them; None where unknown.
            speed_mm_per_s: (F,) of the target that moves fastest.
            averaged: True for those of the mean cycle, from which quantities are made: their loads have the
                noise of what was seen told apart.
        """
        found: dict[int, WallState] = {}
        problems: list[list[str]] = [[] for _ in points]
        order = self._order(points)
        for start in range(0, len(points), _BATCH):
            some = order[start : start + _BATCH]
            walls = [
                (k, self._wall(points[k], vacuum[k], speed_mm_per_s[k], problems[k], averaged[k]))
                for k in some
            ]
            made = {k: wall for k, wall in walls if wall}
            faces, maps = [wall.face for wall in made.values()], [wall.pressure for wall in made.values()]
            states = wall_states([points[k] for k in made], faces, self.question, maps)
            found |= dict(zip(made, states, strict=True))
            for k, state in zip(made, states, strict=True):
                problems[k] += state.problems
            for done, _ in enumerate(some, start + 1):
                self.progress(done, len(points))
        for name, of_state in zip(names, problems, strict=True):
            self.note(name, of_state)
        return sorted(found.items())

    def _order(self, points: Sequence[Points]) -> list[int]:
        """Indices of the points, with a pressure from the open wall to the closed one.

        Every load is then sought from a known one near it, which takes a third of the time.
        """
        if self.pressure is None:
            return list(range(len(points)))
        departures = [departure_mm(self.question.grid, one) for one in points]
        return [int(k) for k in np.argsort(departures, kind="stable")]

    def _wall(
        self,
        points: Points,
        vacuum: ChamberVacuum | None,
        speed_mm_per_s: float,
        problems: list[str],
        averaged: bool,
    ) -> "_Wall | None":
        """Wall of one field or phase; None, with a problem, if its points determine no face."""
        try:
            settled = self._settled(points, vacuum, problems)
            if self.pressure is None or vacuum is None or settled is None:
                return _Wall(self._surface(points), None)
            face = self._surface(points) if settled.wall.contradicted else self._face(settled)
            within = face.within(*self.question.places)
            pressure = self.pressure.of_settled(settled.wall, within, vacuum, speed_mm_per_s, split=averaged)
            return _Wall(face, pressure)
        except AnalysisError as error:
            problems.append(error.message)
            return None

    def _settled(
        self, points: Points, vacuum: ChamberVacuum | None, problems: list[str]
    ) -> "_Settled | None":
        """Wall in equilibrium; None if it is not asked for or, with a problem, if there is none.

        Raises:
            AnalysisError: the points are too few for a surface.
        """
        if self.pressure is None or vacuum is None:
            return None
        kept, left_out = possible(self.question.grid, points)
        try:
            return _Settled(self.pressure.settled(kept, vacuum), kept, left_out)
        except AnalysisError as error:
            problems.append(error.message)
            return None

    def _face(self, settled: "_Settled") -> Face:
        """Face of a wall in equilibrium."""
        assert self.pressure is not None
        grid, outlying = self.question.grid, settled.wall.left_out
        seen = np.setdiff1d(grid.indices(settled.points.target), outlying)
        problems = (*settled.problems, *left_out_problems(grid, outlying))
        return self.pressure.face(settled.wall, supported_places(grid, seen), problems)

    def _surface(self, points: Points) -> Surface:
        """Smooth surface of one field or phase.

        Raises:
            AnalysisError: its points determine none.
        """
        question = self.question
        if question.over is not None:
            return fit_free_surface(points.xyz_mm, points.covariance_mm2, question.over)
        smoothing = self.smoothings.for_points(points) if self.smoothings else None
        return fit_surface(question.grid, points, smoothing)


class _Wall(NamedTuple):
    """Outer face and pressure of one field; None if an input is missing or there is no equilibrium."""

    face: Face
    pressure: PressureMap | None


class _Settled(NamedTuple):
    """Wall in equilibrium, the points that it was fitted to, and what is said of the others."""

    wall: SettledWall
    points: Points
    problems: tuple[str, ...]
