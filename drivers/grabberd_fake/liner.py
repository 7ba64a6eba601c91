"""The scene `liner`: targets on a wall in equilibrium, which follows the vacuum from state to state of rest.

The states and everything true of them come from tables (`wall_states`), where the wall is solved as a thick
solid on its teat. This module places a patch of targets on the wall and moves it in time.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.discs import Targets, grid_numbers
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.optics import Array
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_fake.wall_states import Patch, WallStates, unit_normals, wall_states

_STEP_S = 1e-3
_TRAVEL_KPA = 0.05


class Liner:
    """The scene `liner`."""

    moves = True

    def __init__(self, options: LinerOptions) -> None:
        self.row, self.column = grid_numbers(options.rows, options.columns)
        self.ids: NDArray[np.int32] = np.arange(1, len(self.row) + 1, dtype=np.int32)
        self._options, self._states = options, wall_states(options.wall)
        frames = Patch(self._states, *patch_places(options)).frames(self._states.outer_states_mm)
        # The places of the targets are linear in the nodes': so they are read once for every state.
        self._frames = frames.reshape(len(frames), 3, -1, 3)
        self._movement = movement(options)

    def targets(self, time_ns: int) -> Targets:
        """Points over the outer face, and normals."""
        return self._at(self._movement.rest_kpa(time_ns))

    def nominal(self) -> Targets:
        """The mounted liner on its teat without a pressure difference, as in the object model."""
        return self._at(0.0)

    def _at(self, outer_kpa: float) -> Targets:
        points, along, around = self._states.between(self._frames, outer_kpa)
        normals = unit_normals(along, around)
        lifted = points + normals * self._options.target_thickness_mm
        return Targets(in_object_frame(self._options, lifted), normals)


def patch_places(options: LinerOptions) -> tuple[Array, Array]:
    """Places of the rows along the mounted liner (R,), mm, and angles of the columns (C,)."""
    pitch_mm = options.pitch_mm
    row: Array = np.arange(options.rows, dtype=np.float64) - (options.rows - 1) / 2
    column: Array = np.arange(options.columns, dtype=np.float64) - (options.columns - 1) / 2
    return row * pitch_mm + options.patch_x_mm, column * (pitch_mm / options.outer_radius_mm)


def in_object_frame(options: LinerOptions, points_mm: Array) -> Array:
    """Points (…, 3) of the liner's own frame in the object's."""
    return points_mm + np.array([-options.patch_x_mm, 0.0, options.axis_z_mm])


class Movement:
    """The wall's way through its states of rest, in time.

    It shows the state that belongs to the pressure difference of the moment. Where the wall would then move
    faster than it can, it comes behind: through buckling, and after a steep slope of the vacuum.
    """

    def __init__(self, options: LinerOptions) -> None:
        self._options = options
        self._period_ns = round(options.period_s * 1e9)
        count = max(round(options.period_s / _STEP_S), 2)
        self._part = np.arange(count + 1) / count
        self._lag_kpa = _lag_kpa(options, wall_states(options.wall), self._part[1:])
        self._lag_kpa = np.concatenate([self._lag_kpa[-1:], self._lag_kpa])

    def difference_kpa(self, time_ns: int) -> float:
        """Pressure difference of the gases, outside over inside."""
        # Within one period: a time since start-up would lose digits that a short exposure needs.
        in_period_s = (time_ns % self._period_ns) / 1e9
        return self._options.wave.liner_kpa - float(pulsation_kpa(self._options, np.array(in_period_s)))

    def rest_kpa(self, time_ns: int) -> float:
        """Pressure difference at which the wall would rest where it is."""
        part = (time_ns % self._period_ns) / self._period_ns
        return self.difference_kpa(time_ns) - float(np.interp(part, self._part, self._lag_kpa))


@lru_cache(maxsize=8)
def movement(options: LinerOptions) -> Movement:
    """The movement, worked out once."""
    return Movement(options)


def _lag_kpa(options: LinerOptions, states: WallStates, part: Array) -> Array:
    """Pressure difference of the gases over that of the state shown, at parts of a settled period."""
    gases_kpa = options.wave.liner_kpa - pulsation_kpa(options, part * options.period_s)
    travel_kpa, travel_mm = _travel(states)
    wanted_mm = np.interp(gases_kpa, travel_kpa, travel_mm)
    reach_mm = options.fastest_mm_per_s * options.period_s / len(part)
    if np.abs(np.diff(wanted_mm, append=wanted_mm[0])).max() <= reach_mm:
        return np.zeros_like(part)
    shown_kpa = np.interp(_limited(wanted_mm, reach_mm), travel_mm, travel_kpa)
    # To rounding, the way there and back: what is not late is not late at all.
    return np.where(np.abs(gases_kpa - shown_kpa) < 1e-9, 0.0, gases_kpa - shown_kpa)


def _travel(states: WallStates) -> tuple[Array, Array]:
    """Pressure differences (T,), and the way of the place that moves most from one to the next, summed."""
    # As finely as the interpolation bends: over a whole step between states it may be a quarter faster.
    outer_kpa = np.arange(states.outer_kpa[0], states.outer_kpa[-1] + _TRAVEL_KPA / 2, _TRAVEL_KPA)
    places = [states.outer_mm(kpa) for kpa in outer_kpa.tolist()]
    steps_mm = [np.linalg.norm(after - before, axis=-1).max() for before, after in pairwise(places)]
    return outer_kpa, np.concatenate([[0.0], np.cumsum(steps_mm)])


def _limited(wanted: Array, reach: float) -> Array:
    """A periodic series followed with steps of `reach` at most."""
    at, followed = float(wanted[-1]), wanted.tolist()
    for _ in range(2):  # the second time round it comes from where a settled period ends
        for k, target in enumerate(wanted.tolist()):
            at += min(max(target - at, -reach), reach)
            followed[k] = at
    return np.array(followed)
