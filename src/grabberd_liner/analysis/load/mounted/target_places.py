"""Places of the targets that are glued to the outer face, and their derivatives by the wall."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.rubber import RubberWall
from grabberd_liner.analysis.wall.shell import Geometry

Array = NDArray[np.float64]

_SMALL = 1e-4
"""Step of a logarithm: its square is far below what a place rounds to."""


class Targets(NamedTuple):
    """Material points at which T targets are glued.

    Attributes:
        s_mm: (T,) on the mounted wall's middle, round it; `x_mm`: (T,) along it.
        thickness_mm: of a target, whose face is what is seen.
    """

    s_mm: Array
    x_mm: Array
    thickness_mm: float = 0.0


class TargetPlaces:
    """Places of the targets on a wall.

    Attributes:
        basis: splines at the targets.
    """

    def __init__(self, half: HalfTube, targets: Targets) -> None:
        """Finds the targets on the wall's mesh."""
        self.basis = half.grid.basis(targets.s_mm, targets.x_mm)
        self._thickness_mm = targets.thickness_mm

    def places_mm(self, half: HalfTube, control: Array, tube: MountedTube | None = None) -> Array:
        """(T, 3) targets of a wall with control values (K, 4), of the half's tube or of another one."""
        wall = half.wall(self.basis, tube or half.tube)
        return self._seen(control, Geometry.of(self.basis, control), wall)

    def by_control(self, half: HalfTube, control: Array) -> sparse.csr_matrix:
        """(3 T, 4 K) derivatives of the targets by the control values."""
        geometry, wall = Geometry.of(self.basis, control), half.wall(self.basis, half.tube)
        return self.basis.by_control(_seen_by_values(geometry, wall, self._thickness_mm))

    def by_thickness(self, half: HalfTube, control: Array) -> Array:
        """(3 T,) derivatives by ln t alone, of a wall whose middle stays where it is."""
        geometry = Geometry.of(self.basis, control)
        tubes = half.tube, half.tube.changed(0.0, _SMALL, 0.0)
        before, after = (self._seen(control, geometry, half.wall(self.basis, tube)) for tube in tubes)
        by_thickness: Array = (after - before).ravel() / _SMALL
        return by_thickness

    def _seen(self, control: Array, geometry: Geometry, wall: RubberWall) -> Array:
        height = wall.layer(geometry.forms(), 0.5).depth_mm + self._thickness_mm
        seen: Array = self.basis.of(control)[:, :3] + height[:, np.newaxis] * geometry.director()
        return seen


def _seen_by_values(geometry: Geometry, wall: RubberWall, thickness_mm: float) -> Array:
    """(T, 3, 6, 4) derivatives of the targets by the six derivatives of x, y, z, s."""
    layer = wall.layer(geometry.forms(), 0.5)
    depth = (layer.depth_mm + thickness_mm)[:, np.newaxis, np.newaxis]
    by_depth = np.einsum("en,endc->ndc", layer.by_forms, geometry.forms_by_values())
    by = np.zeros((len(layer.depth_mm), 3, 6, 4))
    by[:, :, 1:] = np.einsum("ndc,ni->nidc", by_depth, geometry.director())
    by[:, :, 1:3, :3] += depth[..., np.newaxis] * geometry.normal_by_tangents()
    by[:, :, 1:3, 3] += depth * geometry.dual.transpose(1, 2, 0)
    by[:, np.arange(3), 0, np.arange(3)] += 1.0
    return by
