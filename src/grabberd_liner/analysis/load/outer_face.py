"""The outer face of the wall in equilibrium, between its targets.

It is sampled at a lattice over the targets' material coordinates and made a spline there. Its errors are
those of the targets' places, and between them those of a smooth field that has these.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.load_fit import Posterior
from grabberd_liner.analysis.load.mounted.mounting import Mounting
from grabberd_liner.analysis.load.mounted.target_places import TargetPlaces, Targets
from grabberd_liner.analysis.surface.face import is_within
from grabberd_liner.analysis.surface.modes import Domain, modes
from grabberd_liner.analysis.surface.smoothing import ROUND
from grabberd_liner.analysis.wall.splines import SplineAxis, SplineGrid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

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
        target_covariance_mm2: (3 T, 3 T) of the targets' places, in the liner's frame.
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
        values, members = self.lattice.splines(u_mm, v_mm, 1)
        by_targets = (values @ self.lattice.by_targets[members])[:, 0]
        count = by_targets.shape[1]
        covariance = self.target_covariance_mm2.reshape(count, 3, count, 3)
        each = [np.tensordot(covariance @ axis, axis, (1, 0)) for axis in self.lattice.axes.T]
        variances = [((by_targets @ one) * by_targets).sum(axis=1) for one in each]
        variance = np.stack(variances, axis=1)
        places = (values @ self.control_mm[members])[:, 0]
        return Estimate(places, np.sqrt(np.maximum(variance, 0.0)))

    def tangents(self, u_mm: Array, v_mm: Array) -> Array:
        """(N, 3, 3) X, X_u, X_v."""
        values, members = self.lattice.splines(u_mm, v_mm, 3)
        tangents: Array = values @ self.control_mm[members]
        return tangents

    def covariance(self, weights: Array, u_mm: Array, v_mm: Array) -> Array:
        """(k, k) covariance of sums over positions of X, X_u, X_v with weights (k, N, at most 3, 3)."""
        count, places, derivatives, _ = weights.shape
        values, members = self.lattice.splines(u_mm, v_mm, derivatives)
        each = values.transpose(0, 2, 1) @ weights.transpose(1, 2, 0, 3).reshape(places, derivatives, -1)
        flat, size = members.ravel(), len(self.control_mm)
        columns = each.reshape(-1, 3 * count).T
        by_lattice = np.stack([np.bincount(flat, column, size) for column in columns], axis=1)
        by_targets = self.lattice.by_targets.T @ by_lattice
        gradient = by_targets.reshape(-1, count, 3).transpose(1, 0, 2) @ self.lattice.axes.T
        gradient = gradient.reshape(count, -1)
        covariance: Array = gradient @ self.target_covariance_mm2 @ gradient.T
        return covariance


class FaceLattice:
    """Places of the face that are sampled, and what they have to do with the targets.

    Attributes:
        domain: the grid of targets.
        by_targets: (K, T) control values over the lattice of a smooth field by its values at the targets.
        axes: (3, 3) rows: the liner's axes in the object's frame.
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
        self._mounting, self.axes = mounting, mounting.frame.axes
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
        tube = model.tube(found.parameters)
        in_frame = self._places.places_mm(model.half, found.control, tube)
        places_mm = mounting.frame.origin_mm + in_frame @ mounting.frame.axes
        covariance = found.places_covariance(mounting.shared_mm2)
        misfit = float(found.outlying.sum()) / len(found.sights)
        return OuterFace(self, self._spline @ places_mm, covariance, supported, misfit, problems)

    def splines(self, u_mm: Array, v_mm: Array, count: int) -> tuple[Array, Indices]:
        """Values, derivatives by u and by v, as many as are wanted, of the splines that matter.

        Returns:
            (N, count, 16), and (N, 16) numbers of their control points.
        """
        values, members = _splines(self._grid, u_mm.tobytes(), v_mm.tobytes())
        return values[:, :count], members


@lru_cache(maxsize=32)
def _splines(grid: SplineGrid, u_mm: bytes, v_mm: bytes) -> tuple[Array, Indices]:
    """Splines as in `FaceLattice`; kept, because areas and targets ask for the same places at every field.

    All derivatives: what asks for a place's tangents asks for its covariance next.
    """
    u, v = np.frombuffer(u_mm), np.frombuffer(v_mm)
    along, around = grid.along.local(u), grid.around.local(v)
    parts = ((0, 0), (1, 0), (0, 1))
    values = [along[a][:, :, np.newaxis] * around[b][:, np.newaxis] for a, b in parts]
    return np.stack(values, axis=1).reshape(len(u), len(parts), -1), grid.members(v, u)


def _smooth(domain: Domain, targets: tuple[Array, Array], nodes: tuple[Array, Array]) -> Array:
    """(K, T) values at nodes of the smoothest field, by its values at the targets."""
    prior = modes(domain, _ALONG * domain.u_pitch_mm, ROUND * domain.v_pitch_mm)
    at_targets, at_nodes = (prior.jets(*places, highest=0)[:, 0] for places in (targets, nodes))
    covariance = at_targets @ at_targets.T
    nugget = _NUGGET * np.eye(len(covariance))
    return np.asarray(np.linalg.solve(covariance + nugget, at_targets @ at_nodes.T).T, np.float64)
