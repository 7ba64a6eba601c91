"""The wall at many fields or phases, several of them at a time.

One choice of smoothing serves each part of the wall's stroke: an open wall is smoother than a closed one.

A ramp with the empty liner: its own values, its collapse, and the material for the other captures.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.collapse import Collapse, RampLevel, collapse, crest_heights
from grabberd_liner.analysis.load.empty_ramp import COLLAPSE, VALUES, LinerValues, liner_values, used_levels
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap, PressureModel, SettledWall
from grabberd_liner.analysis.load.wall_model import Difference
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface, left_out_problems, possible
from grabberd_liner.analysis.surface.free_surface import fit_free_surface
from grabberd_liner.analysis.surface.sections import Face, supported_places
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.chain.analysis.inputs import CHAMBERS, CHANNEL, AnalysisInputs, missing
from grabberd_liner.chain.analysis.vacuum_inputs import channel_sigma_kpa, recorded_channel
from grabberd_liner.chain.analysis.wall_state import (
    FieldPoints,
    Question,
    SingleViews,
    WallState,
    wall_states,
)

T = TypeVar("T")

_MOST_LEVELS = 400
"""Fields of a ramp that are looked at: every few, if it has more."""
_DIGITS = 5


_FEW = 9
"""Fields whose wall is computed where a ramp's own values are not found: as many as give them."""


class RampCourse(NamedTuple):
    """Course of a ramp over its F fields.

    Attributes:
        difference_kpa: (F,) the pressure difference.
        height_mm: (F,) of the inner face over the plane of symmetry, in the row whose walls meet first; NaN
            in fields that were not looked at.
    """

    difference_kpa: Estimate
    height_mm: Estimate


class EmptyLiner(NamedTuple):
    """Result of a ramp; None for what it does not determine.

    Attributes:
        course: of the ramp.
        shown: indices of the fields that the values are from, or of a few, whose wall is worth computing.
        values: the liner's own values, with `material`: the given one with these values.
        collapse: pressure differences at which it buckles and at which its walls touch.
        reasons: why there are no values, and why there is no collapse; empty where there are.
    """

    course: RampCourse
    shown: tuple[int, ...]
    values: LinerValues | None
    material: Material | None
    collapse: Collapse | None
    reasons: tuple[str, str] = ("", "")


def empty_liner(
    grid: Grid,
    inputs: AnalysisInputs,
    reference: Points | None,
    fields: Sequence[FieldPoints],
    vacuum: Sequence[ChamberVacuum],
    views: SingleViews,
    note: Callable[[str], None],
) -> EmptyLiner:
    """Evaluates a ramp; of all but the few fields that it needs, only the crest's height is looked at.

    Args:
        grid: targets of the object model.
        inputs: of the analysis; with material and both vacuums.
        reference: targets of the open liner; None for the object model's.
        fields: of the capture.
        vacuum: at each of the fields.
        views: what tells of targets that one view alone sees.
        note: takes note of a problem: why the data do not determine a result.

    Raises:
        InputError: the σ of a logger's zero is missing.
    """
    material, common_kpa = _material(inputs), _common_sigma_kpa(inputs)
    every = -(-len(fields) // _MOST_LEVELS)
    looked_at = [k for k in range(0, len(fields), every) if len(fields[k].timed.points)]
    levels = [RampLevel(fields[k].timed.points, _difference(vacuum[k], common_kpa)) for k in looked_at]
    used, _ = _tried(lambda: used_levels(grid, material, reference, levels))
    shown = [looked_at[k] for k in used or np.linspace(0, len(levels) - 1, _FEW).round().astype(int)]
    if used:
        for k, one in zip(used, views.points([fields[at] for at in shown]), strict=True):
            levels[k] = levels[k]._replace(points=one)
    values, no_values = _tried(lambda: liner_values(grid, material, reference, levels, common_kpa, views.rig))
    found = values.material(material) if values else None
    ends, no_ends = _tried(lambda: collapse(grid, found or material, reference, levels, common_kpa))
    for reason in filter(None, (no_values, no_ends)):
        note(reason)
    heights, _ = _tried(lambda: crest_heights(grid, found or material, reference, levels))
    course = _course(vacuum, looked_at, heights)
    return EmptyLiner(course, tuple(sorted(set(shown))), values, found, ends, (no_values, no_ends))


def _course(
    vacuum: Sequence[ChamberVacuum], looked_at: Sequence[int], heights: Estimate | None
) -> RampCourse:
    differences = np.array([(one.difference_kpa, one.difference_sigma_kpa) for one in vacuum])
    height_mm = Estimate(*np.full((2, len(vacuum)), np.nan))
    if heights is not None:
        height_mm.value[looked_at], height_mm.sigma[looked_at] = heights
    return RampCourse(Estimate(*differences.T), height_mm)


def _tried(function: Callable[[], T]) -> tuple[T | None, str]:
    """Result of a function, or the reason why the data do not determine it."""
    try:
        return function(), ""
    except AnalysisError as error:
        return None, error.message


def ramp_values(empty: EmptyLiner | None, found: Mapping[str, Finding]) -> dict[str, Any]:
    """Values of the table `ramp` by column name; the quantities among them are given by name."""
    values, material = (empty.values, empty.material) if empty else (None, None)
    rows = 0 if empty is None else 1
    quantities = {name: found[name].estimate for name in (*VALUES, *COLLAPSE)}
    return {
        **{name: Estimate(*(np.full(rows, part) for part in one)) for name, one in quantities.items()},
        "load_misfit": np.full(rows, values.misfit if values else np.nan),
        "levels": np.full(rows, len(values.used) if values else 0),
        "material": np.full(rows, json.dumps(material_document(material)) if material else "", object).astype(
            str
        ),
    }


def material_document(material: Material) -> dict[str, object]:
    """The material as it is given to an analysis."""
    return {
        name: float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
        for name, value in asdict(material).items()
        if value is not None
    }


def _material(inputs: AnalysisInputs) -> Material:
    if len(inputs.zones) != 1:
        raise AnalysisError(
            f"a ramp needs one material for the whole liner, not {len(inputs.zones)} zones",
            "give one material",
        )
    return inputs.zones[0].material


def _common_sigma_kpa(inputs: AnalysisInputs) -> float:
    """σ that the pressure differences of all fields share: of constants, and of a logger's zero."""
    given = {name: inputs.vacuum[name] for name in CHAMBERS}
    constant = [one["sigma_kpa"] for one in given.values() if one not in ("log", CHANNEL)]
    recorded = [recorded_channel(name, inputs.channels) for name in given if given[name] == CHANNEL]
    constant += [channel_sigma_kpa(inputs.vacuum, one) for one in recorded]
    if len(constant) < len(given):
        if "gauge_sigma_kpa" not in inputs.vacuum:
            raise missing(
                "vacuum.gauge_sigma_kpa", "the logger's zero sets the scale of the liner's stiffness"
            )
        constant.append(inputs.vacuum["gauge_sigma_kpa"])
    return float(np.linalg.norm(constant))


def _difference(vacuum: ChamberVacuum, common_kpa: float) -> Difference:
    # The σ of constants is in that of every field as well, and is taken out of it.
    own = max(vacuum.difference_sigma_kpa**2 - common_kpa**2, 0.0)
    return Difference(vacuum.difference_kpa, float(np.sqrt(own)))


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

_STRETCH_MM = 0.3
"""Of the wall's departure, within which one linearised model mostly holds."""

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
        """Indices of the points, with a pressure from the open wall to the closed one, stretch by stretch.

        Every load is then sought from a known one near it. The middle of a stretch comes first: what is
        linearised there holds to both its sides.
        """
        if self.pressure is None:
            return list(range(len(points)))
        departures = np.array([departure_mm(self.question.grid, one) for one in points])
        stretch = np.floor(departures / _STRETCH_MM)
        from_middle = np.abs(departures / _STRETCH_MM - stretch - 0.5)
        return [int(k) for k in np.lexsort((from_middle, stretch))]

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
            settled = self._settled(points, vacuum, problems, averaged)
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
        self, points: Points, vacuum: ChamberVacuum | None, problems: list[str], averaged: bool
    ) -> "_Settled | None":
        """Wall in equilibrium; None if it is not asked for or, with a problem, if there is none.

        Raises:
            AnalysisError: the points are too few for a surface.
        """
        if self.pressure is None or vacuum is None:
            return None
        kept, left_out = possible(self.question.grid, points)
        try:
            return _Settled(self.pressure.settled(kept, vacuum, exact=averaged), kept, left_out)
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
