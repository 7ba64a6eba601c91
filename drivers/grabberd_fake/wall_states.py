"""States of a liner's wall in equilibrium, from the tables that `tools/liner_wall` has solved.

A table holds the outer face and the contact pressure of a quarter of the tube at nodes of quadratic elements,
for a series of pressure differences. In space the elements' own shape functions interpolate; between the
pressures, a cubic through the four nearest states. The liner's own quantities follow from the table alone:
TPPD, CCPD, bending stiffness, contact pressure and load on the teat.
"""

import json
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOLDER = "walls"


class WallStates:
    """The states of one liner on one teat.

    Attributes:
        theta: (A,) angles of the nodes from the line that faces the cameras; a quarter, in rad.
        x_mm: (X,) positions of the nodes along the mounted tube.
        name: name of the table.
        outer_kpa: (S,) pressure differences, outside over inside, ascending.
        outer_states_mm: (S, X, A, 3) float32 outer nodes; `contact_states_kpa`: (S, X, A) float32 contact
            pressure at the inner ones; `force_states_n_per_mm`: (S, X // 2) load on one side.
        snapped: (S,) true where the wall snapped on its way from the state before.
        about: the design and the teat that were solved.
    """

    def __init__(self, name: str, folder: Traversable | None = None) -> None:
        """Reads a table.

        Args:
            name: of the table.
            folder: that holds it; by default the one of this package.

        Raises:
            ValueError: there is none of that name; the message lists those there are.
        """
        table = (folder or files(__package__) / FOLDER) / f"{name}.npz"
        if not table.is_file():
            raise ValueError(f"no wall is named {name!r}; there are {', '.join(wall_names())}")
        self.name = name
        with table.open("rb") as file, np.load(file) as arrays:
            self.theta, self.x_mm = arrays["theta"], arrays["x_mm"]
            self.outer_kpa = arrays["outer_kpa"]
            self.about: dict[str, Any] = json.loads(str(arrays["about"]))
            shifts = np.cumsum(arrays["shift"], axis=0, dtype=np.int32) * arrays["shift_mm"]
            self.outer_states_mm = (arrays["mounted_mm"] + shifts).astype(np.float32)
            contact = np.cumsum(arrays["contact"], axis=0, dtype=np.int32) * arrays["contact_kpa"]
            self.contact_states_kpa = contact.astype(np.float32)
            self.force_states_n_per_mm = arrays["force_n_per_mm"]
            self.snapped: NDArray[np.bool_] = arrays["snapped"]

    def outer_mm(self, outer_kpa: float) -> Array:
        """(X, A, 3) outer nodes at a pressure difference; held at the table's ends."""
        return self.between(self.outer_states_mm, outer_kpa)

    def contact_kpa(self, outer_kpa: float) -> Array:
        """(X, A) contact pressure at the inner nodes."""
        return self._pushing(self.contact_states_kpa, outer_kpa)

    def force_n_per_mm(self, outer_kpa: float) -> Array:
        """(X // 2,) load on one side of the teat over each element along the tube."""
        return self._pushing(self.force_states_n_per_mm, outer_kpa)

    def borders_mm(self, outer_kpa: float) -> Array:
        """(X // 2 + 1,) present places, along the tube, of the borders between its elements."""
        return self.outer_mm(outer_kpa)[::2, :, 0].mean(axis=1)

    def _pushing(self, states: Array | NDArray[np.float32], outer_kpa: float) -> Array:
        # A cubic swings below zero where contact begins between two states; a teat cannot pull.
        return np.maximum(self.between(states, outer_kpa), 0.0)

    def between(self, states: Array | NDArray[np.float32], outer_kpa: float) -> Array:
        """(…) at a pressure difference of anything (S, …) that is known in every state."""
        first, weights = _cubic(self.outer_kpa, outer_kpa)
        return np.tensordot(weights, states[first : first + len(weights)], axes=1)


class Patch:
    """Points of the wall, a grid of rows along the tube and columns round it."""

    def __init__(self, states: WallStates, x_mm: Array, theta: Array) -> None:
        """Prepares the points' weights among the nodes.

        Args:
            states: the table that they are read from.
            x_mm: (R,) along the mounted tube.
            theta: (C,) angles from the line that faces the cameras, within ±π.
        """
        folded, side, below = _folded(theta, states.theta)
        self._mirror = np.stack([np.ones_like(side), side, below], axis=-1)
        self._rows, self._rows_by_x = quadratic_weights(states.x_mm, x_mm)
        self._columns, by_theta = quadratic_weights(states.theta, folded)
        self._columns_by_theta = by_theta * (below * side)[:, np.newaxis]

    def values(self, grid: Array) -> Array:
        """(R, C) of a scalar (X, A) that is the same on the mirrored parts of the tube."""
        return self._rows @ grid @ self._columns.T

    def frames(self, grids_mm: Array | NDArray[np.float32]) -> Array:
        """(…, 3, R, C, 3) of faces (…, X, A, 3): points, ∂/∂x and ∂/∂θ, in the mounted tube's coordinates."""
        weights = (
            (self._rows, self._columns),
            (self._rows_by_x, self._columns),
            (self._rows, self._columns_by_theta),
        )
        frames = [self._mapped(rows, grids_mm, columns) * self._mirror for rows, columns in weights]
        return np.stack(frames, axis=-4)

    def surface(self, grid_mm: Array) -> tuple[Array, Array]:
        """Points (R, C, 3) and outward unit normals (R, C, 3) of a face (X, A, 3)."""
        points, along, around = self.frames(grid_mm)
        return points, unit_normals(along, around)

    @staticmethod
    def _mapped(rows: Array, grids_mm: Array | NDArray[np.float32], columns: Array) -> Array:
        return np.einsum("rx,...xai,ca->...rci", rows, grids_mm, columns, optimize=True)


def _folded(theta: Array, solved: Array) -> tuple[Array, Array, Array]:
    """Angles moved into the solved part of the tube, and the signs of y and z that this mirrors."""
    side = np.where((theta < 0) & (solved[0] > -0.1), -1.0, 1.0)
    folded = theta * side
    behind = (np.abs(folded) > np.pi / 2) & (solved[-1] < np.pi - 0.1)
    return np.where(behind, np.copysign(np.pi, folded) - folded, folded), side, np.where(behind, -1.0, 1.0)


def unit_normals(along: Array, around: Array) -> Array:
    """(…, 3) unit vectors along `along` × `around`; several times as fast as numpy's own for few vectors."""
    (ax, ay, az), (bx, by, bz) = np.moveaxis(along, -1, 0), np.moveaxis(around, -1, 0)
    normal = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
    return normal / np.sqrt((normal * normal).sum(axis=-1, keepdims=True))


def wall_names() -> list[str]:
    """Names of all tables."""
    folder = files(__package__) / FOLDER
    return sorted(
        entry.name.removesuffix(".npz") for entry in folder.iterdir() if entry.name.endswith(".npz")
    )


@lru_cache(maxsize=4)
def wall_states(name: str) -> WallStates:
    """A table, read once."""
    return WallStates(name)


def quadratic_weights(nodes: Array, at: Array) -> tuple[Array, Array]:
    """Weights (N, K) of the values at K equidistant nodes at positions (N,), and of their slope.

    Each element has three nodes and shares the outer ones with its neighbours.
    """
    step = nodes[1] - nodes[0]
    element = np.clip(np.floor((at - nodes[0]) / (2 * step)), 0, len(nodes) // 2 - 1).astype(np.intp)
    local = (at - nodes[2 * element + 1]) / step
    shapes = np.stack([local * (local - 1) / 2, 1 - local**2, local * (local + 1) / 2], axis=1)
    slopes = np.stack([local - 0.5, -2 * local, local + 0.5], axis=1) / step
    weights, by = np.zeros((len(at), len(nodes))), np.zeros((len(at), len(nodes)))
    members = 2 * element[:, np.newaxis] + np.arange(3)
    np.put_along_axis(weights, members, shapes, axis=1)
    np.put_along_axis(by, members, slopes, axis=1)
    return weights, by


def _cubic(knots: Array, at: float) -> tuple[int, Array]:
    """First index, and weights of up to four neighbouring values at `at`: Lagrange's cubic."""
    inside = float(np.clip(at, knots[0], knots[-1]))
    interval = int(np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2))
    first = int(np.clip(interval - 1, 0, max(len(knots) - 4, 0)))
    near = knots[first : first + 4]
    weights = np.array(
        [
            np.prod([(inside - other) / (own - other) for other in np.delete(near, i)])
            for i, own in enumerate(near)
        ]
    )
    return first, weights


_BEFORE_TOUCH = 3
"""States before the touch through which the wall's height is drawn on to it."""


class TeatLoad(NamedTuple):
    """Load of a wall on its teat.

    Attributes:
        mean_kpa: mean contact pressure over the nodes that are pressed by more than a tenth of a kPa.
        peak_kpa: greatest contact pressure at a node.
        peak_n_per_mm: greatest load per height, on one side.
        force_n: load on one side from the mouthpiece to the teat's end.
    """

    mean_kpa: float
    peak_kpa: float
    peak_n_per_mm: float
    force_n: float


def touch_kpa(states: WallStates) -> float:
    """TPPD: pressure difference at which opposite walls of the empty liner meet.

    The wall's height over the pressure difference, continued from the states before the touch, reaches there
    the height that it has in the first state with contact.

    Raises:
        ValueError: the table has a teat, or its walls do not meet.
    """
    _require_empty(states)
    contact = states.contact_states_kpa
    touching = np.flatnonzero(contact.max(axis=(1, 2)) > 0)
    if not len(touching):
        raise ValueError(f"the walls of {states.name} do not meet up to {states.outer_kpa[-1]:g} kPa")
    first = int(touching[0])
    section, _ = np.unravel_index(int(contact[first].argmax()), contact[first].shape)
    before = slice(first - _BEFORE_TOUCH, first)
    above_mm = states.outer_states_mm[:, section, 0, 2] - states.outer_states_mm[first, section, 0, 2]
    return float(np.polyfit(above_mm[before], states.outer_kpa[before], _BEFORE_TOUCH - 1)[-1])


def buckling_kpa(states: WallStates) -> float:
    """CCPD: pressure difference at which the empty liner buckles.

    It is where two straight lines meet: the height of the section that closes first, over the pressure
    difference, near no difference, and where it falls most steeply.

    Raises:
        ValueError: the table has a teat.
    """
    _require_empty(states)
    heights_mm = states.outer_states_mm[:, :, 0, 2].astype(np.float64)
    slopes = np.diff(heights_mm, axis=0) / np.diff(states.outer_kpa)[:, np.newaxis]
    steepest, section = np.unravel_index(int(slopes.argmin()), slopes.shape)
    open_ = int(np.searchsorted(states.outer_kpa, 0.0))
    height_mm, slope = heights_mm[:, section], slopes[:, section]
    middle_kpa = states.outer_kpa[steepest : steepest + 2].mean()
    middle_mm = height_mm[steepest : steepest + 2].mean()
    at_zero_mm = middle_mm - slope[steepest] * middle_kpa
    return float((height_mm[open_] - at_zero_mm) / (slope[steepest] - slope[open_]))


def stiffness_n_mm(states: WallStates) -> float:
    """Bending stiffness E t³ / 9 of an incompressible wall, as designed."""
    design = states.about["design"]
    return float(design["young_mpa"] * design["wall_mm"] ** 3 / 9)


def teat_load(states: WallStates, outer_kpa: float) -> TeatLoad:
    """Load on the teat at a pressure difference; walls that meet below its end are left out.

    Raises:
        ValueError: the table has no teat.
    """
    if states.about["teat"] is None:
        raise ValueError(f"{states.name} has no teat")
    end_mm = states.about["teat"]["end_x_mm"]
    contact = states.contact_kpa(outer_kpa)[states.outer_mm(outer_kpa)[:, 0, 0] < end_mm]
    force, borders_mm = states.force_n_per_mm(outer_kpa), states.borders_mm(outer_kpa)
    beside_mm = np.clip(end_mm, borders_mm[:-1], borders_mm[1:]) - borders_mm[:-1]
    return TeatLoad(
        mean_kpa=float(contact[contact > 0.1].mean()) if (contact > 0.1).any() else 0.0,
        peak_kpa=float(contact.max()),
        peak_n_per_mm=float(force[beside_mm > 0].max()),
        force_n=float(force @ beside_mm),
    )


def _require_empty(states: WallStates) -> None:
    if states.about["teat"] is not None:
        raise ValueError(f"{states.name} has a teat: choose the empty liner")
