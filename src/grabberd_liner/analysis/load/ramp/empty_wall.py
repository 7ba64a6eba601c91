"""The wall without a teat, as a function of the liner's own values and the pressure difference.

What is known of a mounted liner is its outer face, where the targets are. So a thicker wall is one whose
middle lies farther in: had it its middle where it was, the targets would say how thick it is.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.load.load_prior import MPA_PER_KPA
from grabberd_liner.analysis.load.mounted.target_places import TargetPlaces, Targets
from grabberd_liner.analysis.wall.half_tube import HalfTube
from grabberd_liner.analysis.wall.shell import Load

Array = NDArray[np.float64]

_STEPS = np.diag([1e-4, 1e-4, 1e-4, 1e-1])
"""Of difference quotients by a state's values: their squares are far below what a residual rounds to."""


class Settling(NamedTuple):
    """Movement of an empty wall towards equilibrium and with its values, about a state.

    Attributes:
        places_mm: (T, 3) targets in that state.
        unknowns: (n, 5) what its unknowns still move by, then their derivatives by the four values.
        targets: (3 T, 5) the same of the targets.
    """

    places_mm: Array
    unknowns: Array
    targets: Array


class EmptyWall:
    """The wall. The hidden half is the mirror image of the seen one.

    Its four values are the logarithmic changes of Young's modulus, thickness and pretension from those of the
    mounted tube, and the pressure difference in kPa. Its shape is the departure (K, 4) of its control values
    from those of the open wall.
    """

    def __init__(self, half: HalfTube, targets: Targets) -> None:
        """Takes a mounted wall with targets."""
        self._half = half
        self._places = TargetPlaces(half, targets)
        self._none = np.zeros(len(half.s_mm))
        across = half.mounted[:, 1:3]
        outward = across / np.linalg.norm(across, axis=1, keepdims=True)
        self._outward = np.zeros_like(half.mounted)
        self._outward[:, 1:3] = outward

    @property
    def open_shape(self) -> Array:
        """(K, 4) shape of the open wall."""
        return np.zeros_like(self._half.mounted)

    def flattened(self, amplitude_mm: float) -> Array:
        """(K, 4) shape of a wall that has flattened towards the middle without stretching round it, about."""
        x, y, z, _ = self._half.mounted.T
        theta = np.arctan2(y, z)
        along = amplitude_mm * np.cos(np.pi * x / self._half.tube.length_mm) ** 2
        inward, aside = along * np.cos(2 * theta), along * np.sin(2 * theta) / 2
        shape = -inward[:, np.newaxis] * self._outward
        shape[:, 1] += aside * np.cos(theta)
        shape[:, 2] -= aside * np.sin(theta)
        free = self._half.cuts.free
        unknowns = free.T @ shape.ravel() / np.asarray(free.sum(axis=0)).ravel()
        return self._half.moved(self.open_shape, unknowns)

    def places_mm(self, shape: Array, values: Array) -> Array:
        """(T, 3) targets."""
        half = self._of(values)
        return self._places.places_mm(half, half.mounted + shape)

    def moved(self, shape: Array, unknowns: Array) -> Array:
        """(K, 4) shape moved by its unknowns (n,)."""
        return self._half.moved(shape, unknowns)

    def settling(self, shape: Array, values: Array) -> Settling:
        """The wall about a state."""
        half = self._of(values)
        control = half.mounted + shape
        residual, places = self._state(shape, values)
        stepped = [(self._state(shape, values + step), step.sum()) for step in _STEPS]
        forces = [residual, *((force - residual) / size for (force, _), size in stepped)]
        moved = [np.zeros(places.size), *((there - places).ravel() / size for (_, there), size in stepped)]
        factors = half.tangent(control, self._load(values)).factors
        unknowns = factors.solve(np.column_stack(forces))
        by_control = self._places.by_control(half, control)
        targets = by_control @ (half.cuts.free @ unknowns) + np.column_stack(moved)
        return Settling(places, unknowns, targets)

    def _state(self, shape: Array, values: Array) -> tuple[Array, Array]:
        """(n,) force out of balance, and (T, 3) targets."""
        half = self._of(values)
        control = half.mounted + shape
        return half.residual(control, self._load(values)), self._places.places_mm(half, control)

    def _of(self, values: Array) -> HalfTube:
        tube = self._half.tube.changed(*values[:3])
        inward_mm = (tube.thickness_mm - self._half.tube.thickness_mm) / 2
        tube = replace(tube, radius_mm=tube.radius_mm - inward_mm)
        return self._half.of(tube, self._half.mounted - inward_mm * self._outward)

    def _load(self, values: Array) -> Load:
        return Load(float(values[3]) * MPA_PER_KPA, self._none, np.stack([self._none, self._none]))
