"""The wall without a teat, as a function of the liner's own values and the pressure difference."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.load.load_prior import MPA_PER_KPA
from grabberd.analysis.load.target_places import TargetPlaces, Targets
from grabberd.analysis.wall.half_tube import HalfTube
from grabberd.analysis.wall.shell import Load

Array = NDArray[np.float64]

VALUES = 4
"""Logarithmic changes of Young's modulus, thickness and pretension; the pressure difference in kPa."""
_STEPS = np.array([1e-4, 1e-4, 1e-4, 1e-1])
"""Of a difference quotient: its error is far below a residual's rounding."""


class Settled(NamedTuple):
    """How an empty wall settles and follows its values, about a state that need not be in equilibrium.

    Attributes:
        places_mm: (T, 3) targets in that state.
        settling: (n,) what its unknowns still move by; `by_values`: (n, 4) their derivatives.
        places_settling: (3 T,) what the targets still move by; `places_by_values`: (3 T, 4) their derivatives.
    """

    places_mm: Array
    settling: Array
    by_values: Array
    places_settling: Array
    places_by_values: Array


class EmptyWall:
    """The wall.

    Attributes:
        half: the half tube; the hidden half is its mirror image, which without a teat is no assumption about it.
    """

    def __init__(self, half: HalfTube, targets: Targets) -> None:
        """Takes a mounted wall with targets."""
        self.half = half
        self._places = TargetPlaces(half, targets)

    def places_mm(self, control: Array, values: Array) -> Array:
        """(T, 3) targets of a state: control values (K, 4) and the liner's (4,)."""
        return self._places.places_mm(control, self.half.tube.changed(*values[:3]))

    def settled(self, control: Array, values: Array) -> Settled:
        """The wall about a state."""
        half = self.half.of(self.half.tube.changed(*values[:3]))
        residual = half.residual(control, self._load(values))
        columns = [(self._residual(control, values + step) - residual) / size for step, size in _differences()]
        factors = half.tangent(control, self._load(values)).factors
        moves = factors.solve(np.column_stack([residual, *columns]))
        places, by_control, by_thickness = self._places.derived(control, half.tube)
        seen = by_control @ (half.cuts.free @ moves)
        seen[:, 2] += by_thickness
        return Settled(places, moves[:, 0], moves[:, 1:], seen[:, 0], seen[:, 1:])

    def _residual(self, control: Array, values: Array) -> Array:
        half = self.half.of(self.half.tube.changed(*values[:3]))
        return half.residual(control, self._load(values))

    def _load(self, values: Array) -> Load:
        none = np.zeros(len(self.half.s_mm))
        return Load(float(values[3]) * MPA_PER_KPA, none, np.zeros((2, len(none))))


def _differences() -> list[tuple[Array, float]]:
    return [(step * np.eye(VALUES)[index], float(step)) for index, step in enumerate(_STEPS)]
