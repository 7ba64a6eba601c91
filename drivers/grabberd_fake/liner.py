"""The scene `liner`: targets on a wall in equilibrium, which follows the vacuum from state to state of rest.

The states and everything true of them come from tables (`wall_states`), where the wall is solved as a thick
solid on its teat. This module places a patch of targets on the wall and moves it in time.

The scene `ellipse`: a tube that collapses elliptically about the middle of its length, once a pulsation.

It moves as prescribed and is not in equilibrium: nothing presses it so, there is no teat, and its shape would
ask for friction that nothing gives. Use it as a cheap moving shape of closed form, never to judge pressures
by; `liner` is for that. Middle surface: S(x, s, t) = (x, y(s, d), axis_z + z(s, d)), d(x, t) = deflection ·
profile(x) · closure(t), with s the arc length round the wall from the line that faces the cameras and (y, z)
on an ellipse of semi-axis radius − d towards the cameras and of the open liner's perimeter. Targets lie half
a wall (and their thickness) off along the normal, at constant x and s: distances round the wall never change.
"""

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.liner_options import EllipseOptions, LinerOptions
from grabberd_fake.optics import Array, Targets, grid_numbers
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


# Flatter sections than .7 of the radius are refused by `EllipseOptions`: the table need not go further.
_STEPS = 2048
_FLATTEST = 0.7


class Wall(NamedTuple):
    """The middle surface at N places.

    Attributes:
        xyz_mm: (N, 3) points, object's frame.
        along_s: (N, 3) unit tangent round the wall; `along_x`: (N, 3) tangent ∂S/∂x.
        normal: (N, 3) unit normal, outward.
    """

    xyz_mm: Array
    along_s: Array
    along_x: Array
    normal: Array


class EllipseLiner:
    """The scene `ellipse`, for geometry only."""

    moves = True

    def __init__(self, options: EllipseOptions) -> None:
        self._options = options
        rows, columns = grid_numbers(options.rows, options.columns)
        self.row, self.column = rows, columns
        self.ids: NDArray[np.int32] = np.arange(1, len(rows) + 1, dtype=np.int32)
        self._x_mm = (rows.astype(np.float64) - (options.rows - 1) / 2) * options.pitch_mm
        arcs_mm = (np.arange(options.columns) - (options.columns - 1) / 2) * options.pitch_mm
        self._sections = Sections(options.radius_mm, tuple(float(arc) for arc in arcs_mm))
        self._profile, self._profile_by_x = profile(self._x_mm, options.length_mm)

    def targets(self, time_ns: int) -> Targets:
        """Points on the outer face, and normals."""
        wall = self.wall(time_ns)
        return Targets(wall.xyz_mm + wall.normal * self._options.targets_over_middle_mm, wall.normal)

    def nominal(self) -> Targets:
        """The open liner, as in the object model."""
        wall = self._wall(0.0)
        return Targets(wall.xyz_mm + wall.normal * self._options.targets_over_middle_mm, wall.normal)

    def wall(self, time_ns: int) -> Wall:
        """The middle surface under the targets."""
        return self._wall(closure(self._options, time_ns))

    def _wall(self, closed: float) -> Wall:
        depth = self._options.deflection_mm * closed
        section = self._sections.at(depth * self._profile, self.column)
        y, z, y_by_d, z_by_d, tangent_y, tangent_z = section
        by_x = depth * self._profile_by_x
        zero, one = np.zeros_like(y), np.ones_like(y)
        along_s = np.stack([zero, tangent_y, tangent_z], axis=1)
        along_x = np.stack([one, y_by_d * by_x, z_by_d * by_x], axis=1)
        places = np.stack([self._x_mm, y, z + self._options.axis_z_mm], axis=1)
        return Wall(places, along_s, along_x, _outward(along_s, along_x))


def _outward(along_s: Array, along_x: Array) -> Array:
    """Unit vectors along ∂S/∂x × ∂S/∂s, with the first component of `along_s` zero and of `along_x` one."""
    (_, ty, tz), (_, a, b) = along_s.T, along_x.T
    normal = np.stack([a * tz - b * ty, -tz, ty], axis=1)
    return normal / np.sqrt((normal * normal).sum(axis=1, keepdims=True))


def profile(x_mm: Array, length_mm: float) -> tuple[Array, Array]:
    """Collapse along the length, 1 in the middle, smoothly 0 at the ends; and its derivative by x."""
    inside = np.abs(x_mm) < length_mm / 2
    angle = np.pi * x_mm / length_mm
    value = np.where(inside, np.cos(angle) ** 2, 0.0)
    return value, np.where(inside, -np.pi / length_mm * np.sin(2 * angle), 0.0)


def closure(options: EllipseOptions, time_ns: int) -> float:
    """Degree of closing, 0 to 1, through opening (a, from each period's start), open, closing and closed (d).

    The transitions are cubic, so the speed is continuous and at most 1.5 times the mean.
    """
    period_ns = round(options.period_s * 1e9)
    part = (time_ns % period_ns) / period_ns
    if part < options.opening:
        return 1.0 - _smooth(part / options.opening)
    return _smooth((part - options.opening - options.open) / options.closing)


def _smooth(part: float) -> float:
    clipped = min(max(part, 0.0), 1.0)
    return clipped * clipped * (3.0 - 2.0 * clipped)


class Sections:
    """The family of cross-sections of one perimeter, tabulated over the deflection at some arc lengths.

    Linear interpolation over `_STEPS` steps is exact to a tenth of a micrometre.
    """

    def __init__(self, radius_mm: float, arcs_mm: tuple[float, ...]) -> None:
        self._radius_mm = radius_mm
        self._table = _unit_table(tuple(arc / radius_mm for arc in arcs_mm))

    def at(self, deflection_mm: Array, column: NDArray[np.int32]) -> Array:
        """(6, N): y, z in mm, their derivatives by the deflection, and the unit tangent's y and z.

        Args:
            deflection_mm: (N,) from 0 to .7 of the radius.
            column: (N,) indices of the arc lengths.
        """
        place = deflection_mm * (_STEPS / _FLATTEST / self._radius_mm)
        step = np.minimum(place.astype(np.intp), _STEPS - 1)
        part = (place - step)[:, np.newaxis]
        values = self._table[step, column] * (1 - part) + self._table[step + 1, column] * part
        values[:, :2] *= self._radius_mm
        return values.T


@lru_cache(maxsize=8)
def _unit_table(arcs: tuple[float, ...]) -> Array:
    """(_STEPS + 1, columns, 6) for radius 1: y, z, dy/dd, dz/dd, tangent y, tangent z."""
    deflection = np.linspace(0.0, _FLATTEST, _STEPS + 1)
    p = 1.0 - deflection
    q = widened(p)
    table = np.stack([_unit_sections(p, q, arc) for arc in arcs], axis=1)
    slopes = np.gradient(table[:, :, :2], deflection, axis=0, edge_order=2)
    return np.concatenate([table[:, :, :2], slopes, table[:, :, 2:]], axis=2)


def _unit_sections(p: Array, q: Array, arc: float) -> Array:
    theta = eccentric_angle(p, q, np.full_like(p, arc))
    tangent = np.stack([q * np.cos(theta), -p * np.sin(theta)], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.column_stack([q * np.sin(theta), p * np.cos(theta), tangent])


# The trapezoidal rule over a period of a smooth function converges exponentially: exact to rounding.
_SAMPLES = 128
_ANGLES = np.arange(_SAMPLES) * (2 * np.pi / _SAMPLES)


def perimeter(p: Array, q: Array) -> Array:
    """(N,) perimeters of ellipses with semi-axes p, q (N,), exact to rounding."""
    return _speed(p, q).mean(axis=1) * (2 * np.pi)


def widened(p: Array) -> Array:
    """(N,) second semi-axis of ellipses of perimeter 2π with first semi-axis p (N,), 0.25 < p <= 1."""
    q = 2.0 - p  # first guess: near the circle the semi-axes' mean stays 1; Newton's method does the rest
    for _ in range(8):
        step = (perimeter(p, q) - 2 * np.pi) / _perimeter_by_q(p, q)
        q = q - step
        if np.abs(step).max() < 1e-13:
            break
    return q


def eccentric_angle(p: Array, q: Array, arc: Array) -> Array:
    """(N,) eccentric angle θ of the point (q sin θ, p cos θ) at arc length `arc` (N,) from θ = 0.

    The speed ds/dθ is a cosine series in 2θ, so the arc length is known term by term; Newton inverts it.
    """
    orders = np.arange(1, _SAMPLES // 4)
    speed = _speed(p, q)
    spectrum = np.fft.rfft(speed, axis=1).real / _SAMPLES
    mean, cosines = spectrum[:, 0], 2 * spectrum[:, 2 * orders]
    theta = arc / mean
    for _ in range(8):
        phase = 2 * np.multiply.outer(theta, orders)
        length = mean * theta + (cosines / (2 * orders) * np.sin(phase)).sum(axis=1)
        theta = theta - (length - arc) / np.hypot(q * np.cos(theta), p * np.sin(theta))
    return theta


def _speed(p: Array, q: Array) -> Array:
    return np.hypot(np.multiply.outer(q, np.cos(_ANGLES)), np.multiply.outer(p, np.sin(_ANGLES)))


def _perimeter_by_q(p: Array, q: Array) -> Array:
    rate = np.multiply.outer(q, np.cos(_ANGLES) ** 2) / _speed(p, q)
    return rate.mean(axis=1) * (2 * np.pi)
