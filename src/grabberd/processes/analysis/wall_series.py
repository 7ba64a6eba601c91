"""The wall at many fields or phases, several of them at a time."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis import (
    ChamberVacuum,
    PressureMap,
    PressureModel,
    Surface,
    fit_free_surface,
    fit_surface,
)
from grabberd.errors import AnalysisError
from grabberd.processes.analysis.smoothings import Smoothings
from grabberd.processes.analysis.wall_state import Question, WallState, wall_states
from grabberd.reconstruction import Points

_BATCH = 8
"""Fields evaluated in one batch; larger batches are no faster."""

Array = NDArray[np.float64]
Note = Callable[[str, Iterable[str]], None]


@dataclass(frozen=True, slots=True, eq=False)
class WallSeries:
    """Recipe for the wall states of a capture.

    Attributes:
        question: Quantities to compute for each state.
        smoothings: Smoothings by the wall's departure; None if the targets differ from field to field, in
            which case each field chooses its own.
        pressure: Model of the pressure maps; None if one of its inputs is missing.
        note: Called with the name of a state and its problems.
        done: Called after each state.
    """

    question: Question
    smoothings: Smoothings | None
    pressure: PressureModel | None
    note: Note
    done: Callable[[], None]

    def states(
        self,
        points: Sequence[Points],
        names: Sequence[str],
        vacuum: Sequence[ChamberVacuum],
        speed_mm_per_s: Array,
    ) -> list[tuple[int, WallState]]:
        """States of the points that determine a surface, with their indices in the series.

        Args:
            points: of F fields or phases.
            names: of each of them.
            vacuum: at each of them; empty if unknown.
            speed_mm_per_s: (F,) of the target that moves fastest.
        """
        found: list[tuple[int, WallState]] = []
        for start in range(0, len(points), _BATCH):
            some = range(start, min(start + _BATCH, len(points)))
            fitted = [(k, self._surface(points[k], names[k])) for k in some]
            made = {k: surface for k, surface in fitted if surface}
            maps = [
                self._map(points[k], surface, vacuum[k], speed_mm_per_s[k], names[k]) if vacuum else None
                for k, surface in made.items()
            ]
            states = wall_states(list(made.values()), self.question, maps)
            found += zip(made, states, strict=True)
            for k, state in zip(made, states, strict=True):
                self.note(names[k], state.problems)
            for _ in some:
                self.done()
        return found

    def _map(
        self, points: Points, surface: Surface, vacuum: ChamberVacuum, speed_mm_per_s: float, name: str
    ) -> PressureMap | None:
        """Pressure of one field or phase; None, with a note, if its wall has no equilibrium."""
        if self.pressure is None:
            return None
        try:
            within = surface.within(*self.question.places)
            return self.pressure.map(points, within, vacuum, speed_mm_per_s)
        except AnalysisError as error:
            self.note(name, [error.message])
            return None

    def _surface(self, points: Points, name: str) -> Surface | None:
        """Surface of one field or phase; None, with a note, if its points determine none."""
        question = self.question
        try:
            if question.over is not None:
                return fit_free_surface(points.xyz_mm, points.covariance_mm2, question.over)
            smoothing = self.smoothings.for_points(points) if self.smoothings else None
            return fit_surface(question.grid, points, smoothing)
        except AnalysisError as error:
            self.note(name, [error.message])
            return None
