"""From a capture's points to shape, strain, tension, pressure: by field and of the mean cycle (paper 3.8)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureModel
from grabberd_liner.analysis.load.touch import Touch, first_touch
from grabberd_liner.analysis.pulsation.movement import Movement, first_movement
from grabberd_liner.analysis.pulsation.phase_average import PhaseAverage, Variation, phase_average, variation
from grabberd_liner.analysis.pulsation.phases import Phases, wall_phases
from grabberd_liner.analysis.pulsation.pulsation import Pulsation, fit_pulsation
from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.surface.free_surface import free_shape
from grabberd_liner.analysis.surface.jets import Jets
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.analysis.vacuum.light_clock import FoundLight
from grabberd_liner.analysis.wall.strain import Places, nominal_places, outer_places
from grabberd_liner.chain.analysis.agreement import Candidate, Compared, compared
from grabberd_liner.chain.analysis.inputs import AnalysisInputs, Reference
from grabberd_liner.chain.analysis.problems import Problems
from grabberd_liner.chain.analysis.vacuum_inputs import Vacuum, needs_pulsation, read_vacuum
from grabberd_liner.chain.analysis.wall_series import EmptyLiner, Smoothings, WallSeries, empty_liner
from grabberd_liner.chain.analysis.wall_state import FieldPoints, Question, SingleViews, WallState

Progress = Callable[[int, int], None]
_BOTH = SingleViews()


_NOT_TRACKED = "the object's targets are other points of the wall in every field"


class Cycle(NamedTuple):
    """The pulsation of a capture and of its bursts, with their mean cycle.

    Attributes:
        wall: phases of the wall's movement; None if they cannot be told apart.
        vacuum: ISO phases of the vacuum; None unless it is known as a curve.
    """

    pulsation: Pulsation
    variation: Variation
    wall: Phases | None
    vacuum: Phases | None
    average: PhaseAverage | None


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """Complete result of an analysis.

    Attributes:
        grid: target grid of the object model.
        inputs: inputs of the analysis; their `lacks` names missing inputs and the results missing for them.
        fields: fields that could be analysed.
        movement: movement of all fields, or None if the targets do not move together.
        states: wall states of `fields`, in order.
        phases: wall states of the mean cycle, at `phase` (P,).
        vacuum: vacuum at each of `fields`, empty if not given; `phase_vacuum`: at each of `phase`.
        source: source of the vacuum, with the offset of its clock.
        touch: onset of pressure, as an index into `fields`.
        problems: problems that did not end the analysis, as sentences.
        numbers: (F,) numbers of all fields of the capture that have points; `time_s`: (F,) their times.
        reference: reference state of the strain, as in `Question`.
        empty: what a ramp with the empty liner says; None for a capture with a teat.
        compared: the pressure beside another method's; None without one.
    """

    grid: Grid
    inputs: AnalysisInputs
    fields: tuple[FieldPoints, ...]
    movement: Movement | None
    cycle: Cycle | None
    states: tuple[WallState, ...]
    phases: tuple[WallState, ...]
    phase: Array
    vacuum: tuple[ChamberVacuum, ...]
    phase_vacuum: tuple[ChamberVacuum, ...]
    source: Vacuum | None
    touch: Touch | None
    problems: tuple[str, ...]
    numbers: NDArray[np.int64]
    time_s: Array
    reference: Surface | Jets | None
    empty: EmptyLiner | None = None
    compared: Compared | None = None


def analyse(
    captures: Sequence[Sequence[FieldPoints]],
    grid: Grid,
    inputs: AnalysisInputs,
    progress: Progress | None = None,
    views: SingleViews = _BOTH,
    light: FoundLight | None = None,
    *,
    pulsating: bool = False,
    reference: Points | None = None,
) -> Analysis:
    """Analyses a capture.

    Args:
        captures: fields of the capture, followed by those of the bursts that are merged with it by phase.
        grid: target grid of the object model.
        inputs: inputs besides the points.
        progress: called with the number of finished states and the total.
        views: what tells of targets that one view alone sees.
        light: that relates the clocks of camera and logger, for `vacuum.offset: light`.
        pulsating: True to refuse, before the long work, a capture whose wall does not pulsate.
        reference: points of the reference state, where that is another capture.

    Raises:
        AnalysisError: no field determines a surface, or the reference state does not; or the wall does not
            pulsate and has to.
        InputError: an input cannot be used with this capture.
    """
    if not captures or not any(len(field.timed.points) for field in captures[0]):
        raise AnalysisError(
            "the capture has no points", "measure it first; its fields have to show the object"
        )
    work = _Work(captures, grid, inputs, progress or (lambda done, of: None), views, light, reference)
    return work.whole(pulsating=pulsating)


class _Work:
    """One analysis while it is made."""

    def __init__(
        self,
        captures: Sequence[Sequence[FieldPoints]],
        grid: Grid,
        inputs: AnalysisInputs,
        progress: Progress,
        views: SingleViews,
        light: FoundLight | None,
        open_liner: Points | None,
    ) -> None:
        self._grid, self._inputs, self._progress, self._views = grid, inputs, progress, views
        self._light, self._open_liner = light, open_liner
        self._timed = [[field.timed for field in capture] for capture in captures]
        self._fields = tuple(captures[0])
        self._time_s = np.array([field.timed.time_s for field in captures[0]])
        self._problems = Problems([field.n for field in self._fields])
        self._reference_state = inputs.reference

    def whole(self, *, pulsating: bool) -> Analysis:
        """Run every step, each after those whose results it needs."""
        # Movement, cycle and vacuum compare the same material point between fields: without homologous
        # targets only the surface itself is left to analyse.
        homologous = self._grid.homologous
        movements = self._problems.survived(lambda: first_movement(self._timed)) if homologous else None
        pulsation = (
            self._problems.survived(lambda: fit_pulsation(movements))
            if movements and not self._inputs.empty
            else None
        )
        if pulsating and pulsation is None:
            raise AnalysisError(
                f"the wall does not pulsate: {self._problems.latest if homologous else _NOT_TRACKED}",
                "capture while the pulsator runs, two cycles at least; or analyse the capture by hand",
            )
        average = self._average(pulsation)
        if homologous:
            self._reference_state = self._existing(self._inputs.reference, average)
        vacuum = self._vacuum(pulsation) if homologous else None
        empty = self._empty(vacuum)
        chosen = list(empty.shown) if empty else list(range(len(self._fields)))
        points = [self._fields[k].timed.points for k in chosen]
        smoothings = Smoothings.of(self._grid, points) if homologous else None
        question = self._question(smoothings, average)
        model = self._pressure(average) if vacuum and not self._inputs.empty else None
        time_s = self._time_s[chosen]
        of_fields = vacuum.at(time_s) if vacuum else []
        of_phases = self._of_phases(vacuum, average, pulsation)
        speeds = [
            movements[0].speed_mm_per_s(time_s) if movements else np.zeros(len(chosen)),
            pulsation.speed_mm_per_s(average.phase) if pulsation and average else np.empty(0),
        ]
        series = WallSeries(question, smoothings, model, self._problems.note, self._progress)
        names = [f"field {self._fields[k].n}" for k in chosen]
        fields, phases = self._states(series, (points, names), average, [of_fields, of_phases], speeds)
        if not fields:
            raise AnalysisError(
                f"none of {len(self._fields)} fields has a surface: {self._problems.most_frequent}",
                "look at the capture's points: are they of this object model?",
            )
        states = tuple(state for _, state in fields)
        found = [
            Candidate("field", self._fields[chosen[k]].n, points[k], of_fields[k], state.pressure)
            for k, state in fields
            if of_fields
        ] + [
            Candidate("phase", average.phase[k], average.points[k], of_phases[k], state.pressure)
            for k, state in phases
            if average and of_phases
        ]
        comparison = self._compared(model, found)
        return Analysis(
            grid=self._grid,
            inputs=self._inputs,
            fields=tuple(self._fields[chosen[k]] for k, _ in fields),
            movement=movements[0] if movements else None,
            cycle=self._cycle(movements, pulsation, average, vacuum),
            states=states,
            phases=tuple(state for _, state in phases),
            phase=average.phase[[k for k, _ in phases]] if average else np.empty(0),
            vacuum=tuple(of_fields[k] for k, _ in fields) if of_fields else (),
            phase_vacuum=tuple(of_phases[k] for k, _ in phases) if of_phases else (),
            source=vacuum,
            touch=self._touch(states),
            problems=self._problems.all(),
            numbers=np.array([field.n for field in self._fields], np.int64),
            time_s=self._time_s,
            reference=question.reference,
            empty=empty,
            compared=comparison,
        )

    def _compared(self, model: PressureModel | None, candidates: Sequence[Candidate]) -> Compared | None:
        """The pressure beside another method's; one without a result is a problem, too."""
        if self._inputs.other_method is None:
            return None
        found = compared(self._inputs.other_method, model, self._grid, candidates)
        if found.reason:
            self._problems.add(f"no agreement with the other method: {found.reason}")
        return found

    def _states(
        self,
        series: WallSeries,
        of_fields: tuple[Sequence[Points], Sequence[str]],
        average: PhaseAverage | None,
        vacuums: Sequence[Sequence[ChamberVacuum]],
        speeds_mm_per_s: Sequence[Array],
    ) -> tuple[list[tuple[int, WallState]], list[tuple[int, WallState]]]:
        """States of the fields and of the mean cycle, each with its index there.

        Args:
            series: recipe for the states.
            of_fields: points of the fields, and their names.
            average: the mean cycle.
            vacuums: at each field and at each phase; empty if unknown.
            speeds_mm_per_s: (F,) and (P,) of the target that moves fastest.
        """
        points, averaged = of_fields[0], list(average.points) if average else []
        count, names = len(points), list(of_fields[1])
        names += [f"phase {phase:g}" for phase in average.phase] if average else []
        # Phases pass through the same states of the wall as fields, so both are sought together.
        found = series.states(
            [*points, *averaged],
            names,
            _each(vacuums[0], count) + _each(vacuums[1], len(averaged)),
            np.concatenate(speeds_mm_per_s),
            [False] * count + [True] * len(averaged),
        )
        fields = [(k, state) for k, state in found if k < count]
        return fields, [(k - count, state) for k, state in found if k >= count]

    def _vacuum(self, pulsation: Pulsation | None) -> Vacuum | None:
        if pulsation is None and needs_pulsation(self._inputs.vacuum) and not self._inputs.empty:
            self._problems.add(
                "no pressure: vacuum.lag finds the clock of the vacuum from the pulsation, and none was "
                "found; give vacuum.offset, or start_s of the pulsator, instead"
            )
            return None
        try:
            vacuum = read_vacuum(
                self._inputs.vacuum, pulsation, self._time_s, self._light, self._inputs.channels
            )
            if vacuum and self._inputs.taken:
                vacuum.at(self._time_s)
        except InputError as error:
            # Nobody asked for these channels, so that they cannot cost the shape.
            if not self._inputs.taken:
                raise
            self._problems.add(f"no pressure: {error.message}")
            return None
        for remark in vacuum.remarks if vacuum else ():
            self._problems.add(remark)
        if vacuum and pulsation and vacuum.is_curve and vacuum.phases is None:
            self._problems.add("the vacuum's curve holds no whole cycle, so it has no ISO phases")
        return vacuum

    def _empty(self, vacuum: Vacuum | None) -> EmptyLiner | None:
        """Result of a ramp; None, with a problem, if there is none."""
        inputs = self._inputs
        if not inputs.empty or inputs.reference is None or not inputs.zones or vacuum is None:
            return None
        stated, reference = inputs.reference, None
        if stated.kind != "nominal":
            reference = self._reference_points(stated, None)
            if stated.kind == "field":
                (reference,) = self._views.points([one for one in self._fields if one.n == stated.value])
        given = inputs, reference, self._fields, vacuum.at(self._time_s), self._views
        return empty_liner(self._grid, *given, self._problems.add)

    def _of_phases(
        self, vacuum: Vacuum | None, average: PhaseAverage | None, pulsation: Pulsation | None
    ) -> Sequence[ChamberVacuum]:
        if vacuum is None or average is None or pulsation is None:
            return ()
        try:
            return vacuum.at(pulsation.reached_s(average.phase))
        # The log of a capture shorter than a cycle does not cover all phases.
        except (InputError, AnalysisError) as error:
            self._problems.add(f"the mean cycle has no pressure: {error.message}")
            return ()

    def _average(self, pulsation: Pulsation | None) -> PhaseAverage | None:
        if pulsation is None:
            return None
        # A reference phase joins the evenly spaced ones, so that it is averaged itself and not its nearest.
        phases = {k / self._inputs.phases for k in range(self._inputs.phases)}
        reference = self._inputs.reference
        if reference and reference.kind == "phase":
            phases.add(reference.value)
        return self._problems.survived(
            lambda: phase_average(self._timed, pulsation, np.array(sorted(phases)))
        )

    def _question(self, smoothings: Smoothings | None, average: PhaseAverage | None) -> Question:
        inputs, grid = self._inputs, self._grid
        if smoothings is None:
            return Question(grid, inputs.heights_mm, inputs.plane, over=free_shape(grid))
        if self._reference_state is None:
            return Question(grid, inputs.heights_mm, inputs.plane, zones=inputs.zones)
        reference, places = self._reference(self._reference_state, smoothings, average)
        return Question(grid, inputs.heights_mm, inputs.plane, reference, places, inputs.zones)

    def _pressure(self, average: PhaseAverage | None) -> PressureModel | None:
        """Model of the pressure maps; None if one of its inputs is missing."""
        inputs, grid, reference = self._inputs, self._grid, self._reference_state
        if reference is None or not inputs.zones:
            return None
        if inputs.zones[0].material.ends_mm is None or "pulsation" not in inputs.vacuum:
            return None
        points = None if reference.kind == "nominal" else self._reference_points(reference, average)
        sought_kpa, unseen = inputs.sought_kpa, inputs.unseen
        return self._problems.survived(
            lambda: PressureModel(grid, inputs.zones, points, sought_kpa, unseen, self._views.rig)
        )

    def _existing(self, reference: Reference | None, average: PhaseAverage | None) -> Reference | None:
        """The reference state; None, with a problem, if it is one of a mean cycle that does not exist."""
        if reference is None or reference.kind != "phase" or average is not None or self._inputs.empty:
            return reference
        self._problems.add(
            f"no strain, tension and pressure: the reference state {reference} does not exist "
            f"({self._problems.latest}); choose a field, or the object model's nominal shape"
        )
        return None

    def _reference(
        self, reference: Reference, smoothings: Smoothings, average: PhaseAverage | None
    ) -> tuple[Surface | Jets, Places]:
        """Surface and targets of the reference state."""
        if reference.kind == "nominal":
            nominal = NominalShape.of(self._grid).jets(self._grid.u_mm, self._grid.v_mm)
            return nominal, nominal_places(self._grid)
        points = self._reference_points(reference, average)
        surface = fit_surface(self._grid, points, smoothings.for_points(points))
        return surface, outer_places(self._grid, points)

    def _reference_points(self, reference: Reference, average: PhaseAverage | None) -> Points:
        if reference.kind == "capture":
            if self._open_liner is None:
                raise InputError(
                    f"the reference state is {reference}, which is not given",
                    "choose a field, a phase, or the object model's nominal shape; a guided test gives it",
                )
            return self._open_liner
        if reference.kind == "phase":
            if average is None:
                raise InputError(
                    f"the reference state {reference} does not exist: {self._problems.latest}",
                    "choose a field, or the object model's nominal shape",
                )
            return average.points[int(np.argmin(np.abs(average.phase - reference.value)))]
        for field in self._fields:
            if field.n == reference.value:
                return field.timed.points
        numbers = f"{self._fields[0].n} to {self._fields[-1].n}"
        raise InputError(f"the reference state {reference} has no points", f"choose one of fields {numbers}")

    def _cycle(
        self,
        movements: list[Movement] | None,
        pulsation: Pulsation | None,
        average: PhaseAverage | None,
        vacuum: Vacuum | None,
    ) -> Cycle | None:
        if pulsation is None or movements is None:
            return None
        return Cycle(
            pulsation=pulsation,
            variation=variation(movements, pulsation),
            wall=self._problems.survived(lambda: wall_phases(pulsation)),
            vacuum=vacuum.phases if vacuum else None,
            average=average,
        )

    def _touch(self, states: Sequence[WallState]) -> Touch | None:
        maps = [(k, state.pressure) for k, state in enumerate(states) if state.pressure]
        if not maps:
            return None
        touch = self._problems.survived(lambda: first_touch([one for _, one in maps]))
        # `first_touch` counts among the fields that have a map; callers index into all analysed fields.
        return touch and touch._replace(field=maps[touch.field][0])


def _each(vacuum: Sequence[ChamberVacuum], count: int) -> list[ChamberVacuum | None]:
    """The vacuum at each of so many states, or None for each if it is not known."""
    return list(vacuum) or [None] * count
