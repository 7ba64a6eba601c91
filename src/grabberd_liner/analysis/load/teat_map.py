"""The contact pressure over the teat's surface, where other methods measure it: by present places along and
round the axis instead of material points of the wall, averaged over cells as large as a sensor's.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import Delaunay, cKDTree

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Joint
from grabberd_liner.analysis.load.load_fit import Posterior
from grabberd_liner.analysis.load.load_profile import LoadProfile, held_apart_by_teat
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.targets import Targets
from grabberd_liner.analysis.wall.shell import Geometry
from grabberd_liner.analysis.wall.splines import Basis

LATTICE_MM = 2.0
"""Pitch of the lattice on the wall: the prior lets the load change over 4.5 mm."""
_PER_CELL = 4
"""Points of a cell, in either direction, over which the map is averaged."""


@dataclass(frozen=True, eq=False)
class TeatMap:
    """The pressure at L points of the wall's inner face, which lies on the teat.

    Attributes:
        x_mm: (L,) present places along the axis: x of the object's frame.
        round_deg: (L,) round it, from the middle of the targets towards +y.
        radius_mm: mean distance of the face from the axis, by which angles are lengths.
        contact_kpa: above the pressure in the liner; what the estimator itself errs by is in the covariance.
        supported: (L,) True where targets are near, and the teat holds the walls apart.
    """

    x_mm: Array
    round_deg: Array
    radius_mm: float
    contact_kpa: Joint
    supported: Mask

    @cached_property
    def _mesh(self) -> Delaunay:
        return Delaunay(self._flat(self.x_mm, self.round_deg))

    def _flat(self, x_mm: Array, round_deg: Array) -> Array:
        """(…, 2) places in mm on the unrolled cylinder of the mean radius."""
        return np.stack([x_mm, np.deg2rad(round_deg) * self.radius_mm], axis=-1)

    def weights(self, x_mm: Array, round_deg: Array, cell_mm: Array) -> tuple[sparse.csr_matrix, Mask]:
        """Weights of the L values in the means over cells, linear between the lattice's points.

        Args:
            x_mm: (M,) middles of the cells along the axis, in the object's frame.
            round_deg: (M,) round it.
            cell_mm: (M,) widths of the square cells on the teat's surface; 0 for a point.

        Returns:
            (M, L) weights, and (M,) True for cells that are supported all over. Others have weights of 0.
        """
        per_cell = 1 if not cell_mm.any() else _PER_CELL
        part = (np.arange(per_cell) + 0.5) / per_cell - 0.5
        within = np.stack(np.meshgrid(part, part, indexing="ij"), axis=-1).reshape(-1, 2)
        at = self._flat(x_mm, round_deg)[:, np.newaxis] + cell_mm[:, np.newaxis, np.newaxis] * within
        corner, share, inside = self._shares(at.reshape(-1, 2))
        whole: Mask = np.logical_and.reduce(inside.reshape(len(x_mm), -1), axis=1)
        mean = share.reshape(len(x_mm), -1) * whole[:, np.newaxis] / len(within)
        # Row after row has as many weights, several of which may be of the same point.
        starts = np.arange(len(x_mm) + 1) * mean.shape[1]
        return sparse.csr_matrix((mean.ravel(), corner.ravel(), starts), (len(x_mm), len(self.x_mm))), whole

    def _shares(self, at: Array) -> tuple[Indices, Array, Mask]:
        """(N, 3) corners of the triangles at places (N, 2), their shares, and (N,) True if supported."""
        found = self._mesh.find_simplex(at)
        corner: Indices = self._mesh.simplices[found].astype(np.intp)
        to_corner: Array = self._mesh.transform[found]
        first = np.einsum("nij,nj->ni", to_corner[:, :2], at - to_corner[:, 2])
        share = np.column_stack([first, 1 - first.sum(axis=1)])
        known = self.supported[corner] & np.isfinite(share)
        inside: Mask = (found >= 0) & np.logical_and.reduce(known, axis=1)
        return corner, np.where(inside[:, np.newaxis], share, 0.0), inside

    @property
    def reach(self) -> tuple[Array, Array]:
        """Least and greatest x_mm and round_deg that are supported, (2,) each."""
        places = np.stack([self.x_mm, self.round_deg])[:, self.supported]
        return places.min(axis=1), places.max(axis=1)


def teat_map(
    found: Posterior,
    contact_kpa: Callable[[Basis], Joint],
    mounting: Mounting,
    supported: Mask,
    profile: LoadProfile,
) -> TeatMap:
    """The map of a wall in equilibrium, between its outermost targets.

    Args:
        found: the wall.
        contact_kpa: gives the contact pressure at points of the mounted wall.
        mounting: of the liner.
        supported: (N,) True for targets that are supported by data.
        profile: the load over height, which says where the teat is.

    Raises:
        AnalysisError: no teat is pressed, or no targets are seen there.
    """
    half, targets, frame = found.model.half, mounting.targets, mounting.frame
    s_mm, mounted_mm = _lattice(targets)
    basis = half.grid.basis(s_mm, mounted_mm)
    geometry = Geometry.of(basis, found.control)
    depth_mm = half.wall(basis, found.model.tube(found.parameters)).layer(geometry.forms(), -0.5).depth_mm
    inner = basis.of(found.control)[:, :3] + depth_mm[:, np.newaxis] * geometry.director()
    nearest = cKDTree(np.column_stack([targets.s_mm, targets.x_mm]))
    _, beside = nearest.query(np.column_stack([s_mm, mounted_mm]))
    x_mm, height_mm = (frame.origin_mm[0] + frame.axes[0, 0] * one for one in (inner[:, 0], mounted_mm))
    first_mm, last_mm = held_apart_by_teat(profile)
    on_teat = supported[beside] & (height_mm >= first_mm) & (height_mm <= last_mm)
    if not on_teat.any():
        raise AnalysisError(
            f"no targets are seen where the teat is, x {first_mm:.0f} to {last_mm:.0f} mm",
            "capture with the teat in view of both cameras",
        )
    return TeatMap(
        x_mm,
        np.rad2deg(np.arctan2(inner[:, 1], inner[:, 2])),
        float(np.hypot(inner[:, 1], inner[:, 2])[on_teat].mean()),
        contact_kpa(basis),
        on_teat,
    )


def _lattice(targets: Targets) -> tuple[Array, Array]:
    """Points (L,) round and along the mounted wall between its outermost targets."""
    axes = (
        np.linspace(one.min(), one.max(), 2 + int(np.ptp(one) / LATTICE_MM))
        for one in (targets.s_mm, targets.x_mm)
    )
    s_mm, x_mm = np.meshgrid(*axes)
    return s_mm.ravel(), x_mm.ravel()
