"""Half tubes in equilibrium, and the independent tables of solved walls that they are held against."""

import numpy as np
from scipy import sparse

from grabberd_fake.wall_states import Patch, WallStates
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.shell import Geometry, Load
from grabberd_liner.analysis.wall.splines import Basis

LENGTH_MM = 130.0
"""Of the solved walls, between the ends that hold them."""


def load(half: HalfTube, difference_mpa: float, contact_mpa=0.0) -> Load:
    """Pressures without friction."""
    count = len(half.s_mm)
    return Load(difference_mpa, np.broadcast_to(contact_mpa, count), np.zeros((2, count)))


def settled(half: HalfTube, control, under: Load):
    """Control values in equilibrium, by Newton's method in steps of at most a millimetre."""
    for _ in range(30):
        step = half.tangent(control, under).factors.solve(half.residual(control, under))
        longest = np.abs(step).max()
        control = half.moved(control, step / max(1.0, longest))
        if longest < 1e-6:
            return control
    raise AssertionError(f"no equilibrium: the last step was {longest:.2g} mm")


def outer_face(half: HalfTube, control, basis: Basis | None = None):
    """(N, 3) points of the outer face."""
    basis = half.shell.basis if basis is None else basis
    geometry = Geometry.of(basis, control)
    depth = half.wall(basis, half.tube).layer(geometry.forms(), 0.5).depth_mm
    return basis.of(control)[:, :3] + depth[:, np.newaxis] * geometry.director()


class SolvedWall:
    """A table, read at the points of quadrature of a half tube that is as oval as the solved wall."""

    def __init__(self, states: WallStates) -> None:
        """Fits the half tube to the mounted face."""
        design = states.about["design"]
        self.states = states
        self.tube = MountedTube(
            design["radius_mm"],
            design["taper"],
            LENGTH_MM,
            design["wall_mm"],
            design["young_mpa"],
            design["pretension_n"],
        )
        ideal = HalfTube(self.tube)
        rows, self._row = np.unique(ideal.x_mm, return_inverse=True)
        columns, self._column = np.unique(ideal.s_mm, return_inverse=True)
        self._patch = Patch(states, rows, columns / self.tube.radius_mm)
        departure = _radius(self.face(0.0)[0]) - _radius(outer_face(ideal, ideal.mounted))
        self.half = HalfTube(self.tube, _fitted(ideal, departure))

    def face(self, outer_kpa: float):
        """Points (N, 3) of the outer face, and its outward normals (N, 3)."""
        points, normals = self._patch.surface(self.states.outer_mm(outer_kpa))
        points, normals = points[self._row, self._column], normals[self._row, self._column]
        return points, normals * np.sign((normals * points * [0, 1, 1]).sum(axis=1).mean())

    def contact_mpa(self, outer_kpa: float):
        """(N,) contact pressure of the table."""
        return self._patch.values(self.states.contact_kpa(outer_kpa))[self._row, self._column] / 1e3

    def departure_mm(self, outer_kpa: float):
        """(N, 3) of the half tube's outer face from the table's, under the table's pressures."""
        under = load(self.half, outer_kpa / 1e3, self.contact_mpa(outer_kpa))
        control = settled(self.half, self._start(outer_kpa), under)
        return outer_face(self.half, control) - self.face(outer_kpa)[0]

    def _start(self, outer_kpa: float):
        """Control values near the state: half a wall inside the table's face."""
        half = self.half
        points, normals = self.face(outer_kpa)
        shift = points - normals * self.tube.thickness_mm / 2 - half.shell.basis.of(half.mounted)[:, :3]
        places = sparse.kron(half.shell.basis.matrices[0], sparse.eye(4).tocsr()[:3])
        by_unknowns = (places @ half.cuts.free).tocsr()
        # The shear moves no place, so the normal equations need a small stiffness for it.
        normal = by_unknowns.T @ by_unknowns + 1e-6 * sparse.eye(half.cuts.count)
        unknowns = sparse.linalg.splu(normal.tocsc()).solve(by_unknowns.T @ shift.ravel())
        return half.moved(half.mounted, unknowns)


def _radius(points):
    return np.hypot(points[:, 1], points[:, 2])


def _fitted(half: HalfTube, values):
    """(K,) control values of the spline nearest to values at the points of quadrature."""
    dense = half.shell.basis.matrices[0]
    return sparse.linalg.splu((dense.T @ dense).tocsc()).solve(dense.T @ values)
