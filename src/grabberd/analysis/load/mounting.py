"""The mounted liner in its own frame, from the object model, the material and the reference state."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.grid import Grid
from grabberd.analysis.load.sights import Sights
from grabberd.analysis.load.target_places import TargetPlaces, Targets
from grabberd.analysis.surface.nominal_shape import NominalShape
from grabberd.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd.analysis.wall.material import Material
from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

Array = NDArray[np.float64]

_DEPARTURE_MM, _SMOOTH_MM = 0.2, 15.0
"""Departure of a mounted wall from a cone, and the length over which it changes."""
_UNSEEN_MM = 0.3
"""σ of a target's place in the face if the reference state does not show it: of glueing by hand."""


@dataclass(frozen=True, slots=True, eq=False)
class Mounting:
    """A liner as mounted.

    Attributes:
        half: the half of it that faces the cameras.
        targets: where the targets of the grid are glued.
        origin_mm: (3,) middle of the tube in the object's frame.
        axes: (3, 3) rows: along the tube, across, and outward through the middle of the targets.
        shared_mm2: (3 N, 3 N) covariance of the targets' places in every state, from that of the reference's.
    """

    half: HalfTube
    targets: Targets
    origin_mm: Array
    axes: Array
    shared_mm2: Array

    @classmethod
    def of(cls, grid: Grid, material: Material, reference: Points | None) -> "Mounting":
        """The liner.

        Args:
            grid: targets of the object model; they have to be on a cylinder.
            material: of the whole wall, with the ends that hold it.
            reference: targets of the open liner; None takes the object model's as exact.

        Raises:
            AnalysisError: the object is no cylinder, or the material has no ends.
        """
        shape = NominalShape.of(grid)
        ends = material.ends_mm
        if shape.radius_mm == 0 or ends is None:
            lacks = "an object model that is a cylinder" if shape.radius_mm == 0 else "the ends of the liner"
            raise AnalysisError(
                f"the wall's equilibrium needs {lacks}",
                "give first_end_mm and last_end_mm of the material: where along x the liner is held",
            )
        along = shape.along / np.linalg.norm(shape.along)
        along = along if along[0] >= 0 else -along
        origin = shape.origin_mm + (sum(ends) / 2 - shape.origin_mm[0]) / along[0] * along
        outward = (grid.nominal_mm - origin).mean(axis=0)
        outward = outward - (outward @ along) * along
        outward = outward / np.linalg.norm(outward)
        axes = np.stack([along, np.cross(outward, along), outward])
        frame = (origin, axes)
        nominal = (grid.nominal_mm - origin) @ axes.T
        _check_ends(ends, grid.nominal_mm[:, 0])
        if reference is None:
            return cls._mounted(nominal, None, material, shape.radius_mm, frame)
        # A target that the reference state does not show keeps its place in the object model.
        seen = grid.indices(reference.target)
        places = nominal.copy()
        places[seen] = (reference.xyz_mm - origin) @ axes.T
        covariance = np.tile(np.diag([_UNSEEN_MM**2, _UNSEEN_MM**2, np.inf]), (len(grid), 1, 1))
        covariance[seen] = axes @ reference.covariance_mm2 @ axes.T
        return cls._mounted(places, covariance, material, shape.radius_mm, frame)

    @classmethod
    def _mounted(
        cls,
        places_mm: Array,
        covariance_mm2: Array | None,
        material: Material,
        radius_mm: float,
        frame: tuple[Array, Array],
    ) -> "Mounting":
        """A mounting with targets at places (N, 3) in its own frame, their covariance (N, 3, 3) or None."""
        assert material.ends_mm is not None
        middle_mm = radius_mm - material.depth_mm
        theta = np.arctan2(places_mm[:, 1], places_mm[:, 2])
        targets = Targets(middle_mm * theta, places_mm[:, 0], material.target_mm)
        first, last = material.ends_mm
        tube = MountedTube(middle_mm, 0.0, last - first, material.wall_mm, material.E_mpa, material.F0_n)
        if covariance_mm2 is None:
            return cls(HalfTube(tube), targets, *frame, np.zeros((3 * len(theta),) * 2))
        radial = np.stack([np.zeros_like(theta), np.sin(theta), np.cos(theta)], axis=1)
        sigma = np.sqrt(np.einsum("ni,nij,nj->n", radial, covariance_mm2, radial))
        away = np.hypot(places_mm[:, 1], places_mm[:, 2]) - radius_mm
        weight = sigma**-2
        taper = -float((weight * targets.x_mm * away).sum() / (weight * targets.x_mm**2).sum())
        tube = replace(tube, taper=taper)
        found = _departure(HalfTube(tube), targets, away + taper * targets.x_mm, sigma)
        half = HalfTube(tube, found.control)
        # What was seen is the wall in equilibrium, not the one that it settles from.
        targets = targets._replace(x_mm=targets.x_mm - _slid_mm(half, targets))
        return cls(half, targets, *frame, _shared(covariance_mm2, radial, found.covariance_mm2))

    @property
    def face_mm(self) -> float:
        """Distance of a target's face from the wall's inner face."""
        return self.half.tube.thickness_mm + self.targets.thickness_mm

    def sights(self, points: Points, grid: Grid, shared: bool = True) -> Sights:
        """Sights of a field's targets, in the liner's frame.

        Args:
            points: of the field.
            grid: targets of the object model.
            shared: true if their covariance includes `shared_mm2`.
        """
        places = np.full((len(grid), 3), np.nan)
        covariance = np.zeros((len(grid), 3, 3))
        index = grid.indices(points.target)
        places[index] = (points.xyz_mm - self.origin_mm) @ self.axes.T
        covariance[index] = self.axes @ points.covariance_mm2 @ self.axes.T
        return Sights.of_points(places, covariance, self.shared_mm2 if shared else None)


def _check_ends(ends_mm: tuple[float, float], x_mm: Array) -> None:
    if ends_mm[0] < x_mm.min() and x_mm.max() < ends_mm[1]:
        return
    raise AnalysisError(
        f"targets at x from {x_mm.min():.1f} to {x_mm.max():.1f} mm are not between the ends that hold the "
        f"liner, {ends_mm[0]:g} and {ends_mm[1]:g} mm",
        "measure first_end_mm and last_end_mm along the liner, in the object model's x",
    )


def _slid_mm(half: HalfTube, targets: Targets) -> Array:
    """(T,) movement of targets along the open wall until it is in equilibrium.

    A tapered tube with the same stretch all along is not: its wall slides by a few tenths of a millimetre.
    """
    places = TargetPlaces(half, targets)
    settled = places.places_mm(half, half.at_rest())
    slid_mm: Array = (settled - places.places_mm(half, half.mounted))[:, 0]
    return slid_mm


class Departure(NamedTuple):
    """Smooth radial departure of a mounted wall from a cone.

    Attributes:
        control: (K,) control values; `covariance_mm2`: (N, N) at the targets.
    """

    control: Array
    covariance_mm2: Array


def _departure(half: HalfTube, targets: Targets, away_mm: Array, sigma_mm: Array) -> Departure:
    """The departure that the reference state's targets show."""
    grid = half.grid
    at = grid.basis(targets.s_mm, targets.x_mm).matrices[0]
    around, along = (
        np.exp(-0.5 * ((axis[:, np.newaxis] - axis) / _SMOOTH_MM) ** 2)
        for axis in (grid.around.greville, grid.along.greville)
    )
    spread = _DEPARTURE_MM**2 * np.kron(along, around) @ at.T
    seen = np.isfinite(sigma_mm)
    prior = at @ spread
    seen_covariance = prior[np.ix_(seen, seen)] + np.diag(sigma_mm[seen] ** 2)
    gain = np.linalg.solve(seen_covariance, np.column_stack([away_mm[seen], prior[seen]]))
    return Departure(spread[:, seen] @ gain[:, 0], prior - prior[:, seen] @ gain[:, 1:])


def _shared(covariance_mm2: Array, radial: Array, departure_mm2: Array) -> Array:
    """(3 N, 3 N) covariance of places: of each target within the face, and of the smooth wall across it."""
    within = np.eye(3) - radial[:, :, np.newaxis] * radial[:, np.newaxis]
    finite = np.where(np.isfinite(covariance_mm2), covariance_mm2, 0.0)
    shared = np.einsum("ni,nm,mj->nimj", radial, departure_mm2, radial)
    each = np.arange(len(radial))
    shared[each, :, each] += within @ finite @ within
    covariance: Array = shared.reshape(3 * len(radial), -1)
    return covariance
