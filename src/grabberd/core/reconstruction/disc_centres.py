"""Centres of discs, from points intersected where each view shows the middles of their pictures.

Neither view shows a disc's centre in the middle of its picture (`geometry.discs`). By how much the point of
both lies beside it depends on the disc's normal: all discs' own, as the object file states it, or that of the
surface which their grid forms at the moment. Where neither is known, the disc may lie any way in which the
views can see it: the mean of these is subtracted, and their spread enters the σ that averaging leaves.
"""

import math
from dataclasses import replace

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Discs, Rig
from grabberd.core.kernel import KERNEL, Kernel
from grabberd.core.reconstruction.correspondence.facing import MOST_OBLIQUE_DEG, normals, wall_slopes
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import FIRST, SECOND, Points

_TILTS, _TURNS = 6, 12
"""Normals that stand for all in which a disc can be seen: equal shares of the cone, all round it."""
_LEAST_MM4 = 1e-9
"""Square of a normal's length, that of an area of the grid, below which there is none (centres.c)."""


class DiscCentres:
    """Correction of points to the centres of their discs, for one object before one rig.

    Depths and lines of sight are those of the nominal places: ten millimetres from them the correction, of
    two thousandths of a millimetre, is wrong by a twentieth.
    """

    def __init__(self, rig: Rig, model: ObjectModel, kernel: Kernel | None = KERNEL) -> None:
        self._target, self._kernel = model.target, kernel
        own = None if model.normal is None else np.array(model.normal) / np.linalg.norm(model.normal)
        stands_for = _visible(rig, model) if own is None else np.broadcast_to(own, (1, len(model), 3))
        moved = np.array([_moved_mm(rig, model, normal) for normal in stands_for])
        self._fixed_mm = moved.mean(axis=0)
        off_mm = moved - self._fixed_mm
        self._spread_mm2 = np.einsum("knx,kny->nxy", off_mm, off_mm) / len(moved)
        self._constant_mm, self._quadratic_mm = _by_normal(rig, model)
        self._along, self._across = along, across = wall_slopes(model)
        self._neighbours = np.array([along.target, across.target], np.int64)
        weights = np.concatenate([along.weight, across.weight]).T
        columns = weights, self._constant_mm, self._quadratic_mm, self._fixed_mm, self._spread_mm2
        self._table = np.concatenate([one.reshape(len(model), -1) for one in columns], axis=1)

    def corrected(self, points: Points, places_mm: Array) -> Points:
        """Move points to the centres of their discs.

        Args:
            points: The points of a field.
            places_mm: (M, 3) places of all targets in it, seen or predicted, which form the surface.
        """
        if not len(points):
            return points
        own = np.searchsorted(self._target, points.target)
        if self._kernel is None:
            xyz_mm, share = self._by_numpy(points, places_mm, own)
        else:
            xyz_mm, share = points.xyz_mm.copy(), points.calibration_covariance_mm2.copy()
            known = self._neighbours, self._table, np.ascontiguousarray(places_mm)
            self._kernel.centres(*known, own, xyz_mm, share)
        return replace(points, xyz_mm=xyz_mm, calibration_covariance_mm2=share)

    def _by_numpy(self, points: Points, places_mm: Array, own: Indices) -> tuple[Array, Array]:
        normal = normals(self._along, self._across, places_mm)[own]
        square = (normal * normal).sum(axis=1)
        known = square > _LEAST_MM4
        products = normal[:, FIRST] * normal[:, SECOND] / np.where(known, square, 1.0)[:, np.newaxis]
        along = (self._quadratic_mm[own] @ products[:, :, np.newaxis])[:, :, 0]
        shift = np.where(known[:, np.newaxis], self._constant_mm[own] - along, self._fixed_mm[own])
        spread = np.where(known[:, np.newaxis, np.newaxis], 0.0, self._spread_mm2[own])
        return points.xyz_mm - shift, points.calibration_covariance_mm2 + spread


def _visible(rig: Rig, model: ObjectModel) -> Array:
    """(K, M, 3) normals of discs that the views can see, evenly over the cone about the mean sight."""
    toward = _sights(rig, model.xyz_mm).mean(axis=0)
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    first = np.cross(toward, np.eye(3)[np.abs(toward).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(toward, first)
    share = (np.arange(_TILTS) + 0.5) / _TILTS
    cosine, turn = np.meshgrid(
        1.0 - share * (1.0 - math.cos(math.radians(MOST_OBLIQUE_DEG))),
        2.0 * math.pi * np.arange(_TURNS) / _TURNS,
    )
    sine = np.sqrt(1.0 - cosine**2)
    parts = np.stack([cosine, sine * np.cos(turn), sine * np.sin(turn)], axis=-1).reshape(-1, 3)
    normals: Array = np.einsum("kb,bmx->kmx", parts, np.array([toward, first, second]))
    return normals


def _moved_mm(rig: Rig, model: ObjectModel, normal: Array) -> Array:
    """(M, 3) from the centres to the points that the middles of both pictures lead to."""
    shifts = Discs(normal, model.target_diameter_mm).shifts_mm(rig, model.xyz_mm)
    moved: Array = np.einsum("mvij,vjm->mi", _pulls(rig, model.xyz_mm), shifts)
    return moved


def _by_normal(rig: Rig, model: ObjectModel) -> tuple[Array, Array]:
    """The same as (M, 3) less (M, 3, 6) times the products of a unit normal's coordinates."""
    axis = rig.rotation[:, 2]
    depth = -np.einsum("vx,vxm->vm", axis, model.xyz_mm.T - rig.center_mm)
    pulls = _pulls(rig, model.xyz_mm) * (0.25 * model.target_diameter_mm**2 / depth.T)[:, :, None, None]
    whole = np.einsum("mvij,vk->mijk", pulls, axis)
    both = whole + whole.swapaxes(2, 3)
    quadratic = both[:, :, FIRST, SECOND]
    quadratic[:, :, [i for i, pair in enumerate(zip(FIRST, SECOND, strict=True)) if pair[0] == pair[1]]] *= (
        0.5
    )
    return np.einsum("mijj->mi", whole), quadratic


def _pulls(rig: Rig, xyz_mm: Array) -> Array:
    """(M, V, 3, 3) share of a view's shift in the shift of the point, with equal errors of all images."""
    sight = _sights(rig, xyz_mm)
    across = np.eye(3) - sight[..., np.newaxis] * sight[..., np.newaxis, :]
    away2 = ((rig.center_mm - xyz_mm.T) ** 2).sum(axis=1)
    weight = across / away2[:, :, np.newaxis, np.newaxis]
    pulls: Array = (np.linalg.inv(weight.sum(axis=0)) @ weight).swapaxes(0, 1)
    return pulls


def _sights(rig: Rig, xyz_mm: Array) -> Array:
    """(V, M, 3) unit vectors toward the views."""
    sight = rig.center_mm.swapaxes(1, 2) - xyz_mm
    unit: Array = sight / np.linalg.norm(sight, axis=2, keepdims=True)
    return unit
