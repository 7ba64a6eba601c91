"""The outer face of the wall in equilibrium, between its targets.

It is sampled at a lattice over the targets' material coordinates and made a spline there. Its errors are those
of the targets' places, and between them those of a smooth field that has these.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.grid import Grid
from grabberd.analysis.load.load_fit import Posterior
from grabberd.analysis.load.mounting import Mounting
from grabberd.analysis.load.target_places import TargetPlaces, Targets
from grabberd.analysis.surface.face import is_within
from grabberd.analysis.surface.modes import Domain, modes
from grabberd.analysis.surface.smoothing import ROUND
from grabberd.analysis.wall.splines import DEGREE, SplineAxis, SplineGrid

Array = NDArray[np.float64]

_PER_PITCH = 2, 3
"""Intervals of the lattice to a pitch of targets, along and round."""
_ALONG = 2.0
"""Pitches over which errors of the face go together along the tube; `ROUND` round it."""
_NUGGET = 1e-8
_SMALL = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class OuterFace:
    """The face at one field, a `Face`.

    Attributes:
        lattice: of the wall's model.
        control_mm: (K, 3) control values over the lattice.
        target_covariance_mm2: (3 T, 3 T) of the targets' places, object's frame.
        supported: as in `Surface`; `misfit`; `problems`.
    """

    lattice: "FaceLattice"
    control_mm: Array
    target_covariance_mm2: Array
    supported: NDArray[np.bool_]
    misfit: float
    problems: tuple[str, ...]

    @property
    def domain(self) -> Domain:
        """The grid of targets."""
        return self.lattice.domain

    def within(self, u_mm: Array, v_mm: Array) -> NDArray[np.bool_]:
        """(N,) True for positions supported by data."""
        return is_within(self.domain, self.supported, u_mm, v_mm)

    def places_mm(self, u_mm: Array, v_mm: Array) -> Estimate:
        """(N, 3) points X, each with σ."""
        rows = self.lattice.derivatives(u_mm, v_mm, 1)
        by_targets, covariance = rows @ self.lattice.by_targets, self.target_covariance_mm2
        own = (covariance[axis::3, axis::3] for axis in range(3))
        variance = np.stack([((by_targets @ one) * by_targets).sum(axis=1) for one in own], axis=1)
        return Estimate(rows @ self.control_mm, np.sqrt(np.maximum(variance, 0.0)))

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""
        tangents: Array = self.lattice.derivatives(u_mm, v_mm) @ self.control_mm
        return tangents.reshape(-1, 3, 3)

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""
        count, places, derivatives, _ = weights.shape
        rows = self.lattice.derivatives(u_mm, v_mm, derivatives)
        flat = weights.transpose(1, 2, 0, 3).reshape(places * derivatives, -1)
        by_targets = self.lattice.by_targets.T @ (rows.T @ flat)
        gradient = by_targets.reshape(-1, count, 3).transpose(1, 0, 2).reshape(count, -1)
        covariance: Array = gradient @ self.target_covariance_mm2 @ gradient.T
        return covariance


class FaceLattice:
    """Places of the face that are sampled, and what they have to do with the targets.

    Attributes:
        domain: the grid of targets.
        by_targets: (K, T) control values over the lattice of a smooth field by its values at the targets.
    """

    def __init__(self, grid: Grid, mounting: Mounting) -> None:
        """Finds the lattice on the mounted wall."""
        rows, columns = int(grid.row.max()) + 1, int(grid.column.max()) + 1
        self.domain = Domain(0.0, 0.0, grid.u_pitch_mm, grid.v_pitch_mm, rows, columns)
        reach_mm = 0.5 * grid.u_pitch_mm
        self._grid = SplineGrid(
            SplineAxis.over(0.0, (columns - 1) * grid.v_pitch_mm, _PER_PITCH[1] * (columns - 1)),
            SplineAxis.over(-reach_mm, (rows - 1) * grid.u_pitch_mm + reach_mm, _PER_PITCH[0] * rows),
        )
        around, along = self._grid.around.greville, self._grid.along.greville
        nodes = np.repeat(along, len(around)), np.tile(around, len(along))
        self._spline = np.linalg.inv(self._grid.basis(nodes[1], nodes[0]).matrices[0].toarray())
        smooth = _smooth(self.domain, (grid.u_mm, grid.v_mm), nodes)
        self.by_targets = self._spline @ smooth
        self._mounting = mounting
        tube, targets = mounting.half.tube, mounting.targets
        # A lattice that reaches beyond the ends or the cuts ends there.
        end_s_mm, end_x_mm = np.pi / 2 * tube.radius_mm - _SMALL, tube.length_mm / 2 - _SMALL
        at = targets._replace(
            s_mm=np.clip(smooth @ targets.s_mm, -end_s_mm, end_s_mm),
            x_mm=np.clip(smooth @ targets.x_mm, -end_x_mm, end_x_mm),
        )
        self._places = TargetPlaces(mounting.half, Targets(*at))

    def face(self, found: Posterior, supported: NDArray[np.bool_], problems: tuple[str, ...]) -> OuterFace:
        """The face of a wall that was fitted to its targets."""
        mounting, model = self._mounting, found.model
        half = model.half.of(model.tube(found.parameters))
        places_mm = mounting.origin_mm + self._places.places_mm(half, found.control) @ mounting.axes
        covariance = found.places_covariance(mounting.shared_mm2)
        size = len(covariance)
        turned = (covariance.reshape(-1, 3) @ mounting.axes).reshape(size, size).T
        turned = (turned.reshape(-1, 3) @ mounting.axes).reshape(size, size)
        misfit = float(found.outlying.sum()) / len(found.sights)
        return OuterFace(self, self._spline @ places_mm, turned, supported, misfit, problems)

    def derivatives(self, u_mm: Array, v_mm: Array, count: int = 3) -> sparse.csr_matrix:
        """(N count, K) values, derivatives by u and by v, as many as are wanted, by the control values."""
        along, around = self._grid.along.local(u_mm), self._grid.around.local(v_mm)
        parts = ((0, 0), (1, 0), (0, 1))[:count]
        values = np.stack([np.einsum("ni,nj->nij", along[a], around[b]) for a, b in parts], axis=1)
        members = self._grid.members(v_mm, u_mm)
        size = (DEGREE + 1) ** 2
        columns = np.broadcast_to(members[:, np.newaxis], (len(members), count, size))
        starts = np.arange(len(members) * count + 1) * size
        shape = (len(members) * count, self._grid.count)
        return sparse.csr_matrix((values.ravel(), columns.ravel(), starts), shape=shape)


def _smooth(domain: Domain, targets: tuple[Array, Array], nodes: tuple[Array, Array]) -> Array:
    """(K, T) values at nodes of the smoothest field, by its values at the targets."""
    prior = modes(domain, _ALONG * domain.u_pitch_mm, ROUND * domain.v_pitch_mm)
    at_targets, at_nodes = (prior.jets(*places, highest=0)[:, 0] for places in (targets, nodes))
    covariance = at_targets @ at_targets.T
    nugget = _NUGGET * np.eye(len(covariance))
    return np.asarray(np.linalg.solve(covariance + nugget, at_targets @ at_nodes.T).T, np.float64)
