"""The mounted liner in its own frame, from the object model, the material and the reference state: the open
wall that this shows, and where on it the targets are glued.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.load.targets import SightLines, Sights, TargetPlaces, Targets
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.material import Material

_DEPARTURE_MM, _SMOOTH_MM = 0.2, 15.0
"""Departure of a mounted wall from a cone, and the length over which it changes."""
_UNSEEN_MM = 0.3
"""σ of a target's place in the face if the reference state does not show it: of glueing by hand."""


class Glued(NamedTuple):
    """N targets on the open wall.

    Attributes:
        places_mm: (N, 3) in the liner's frame; `covariance_mm2`: (3 N, 3 N).
    """

    places_mm: Array
    covariance_mm2: Array


class OpenWall(NamedTuple):
    """A cone and a smooth departure from it, as triangulated targets show it.

    Attributes:
        half: the mounted half tube with that departure; its taper is the cone's.
        face_mm: distance of the targets' faces from the axis, halfway along the cone.
        seen: (S,) indices of the triangulated targets; `places_mm`: (S, 3) and `covariance_mm2`: (S, 3, 3)
            in the liner's frame.
        departures: of the wall.
    """

    half: HalfTube
    face_mm: float
    seen: Indices
    places_mm: Array
    covariance_mm2: Array
    departures: "_Departures"

    @classmethod
    def of(
        cls,
        nominal_mm: Array,
        seen: Indices,
        places_mm: Array,
        covariance_mm2: Array,
        face_mm: float,
        tube: MountedTube,
    ) -> "OpenWall":
        """The wall under triangulated targets.

        Args:
            nominal_mm: (N, 3) nominal places of all targets in the liner's frame.
            seen: (S,) indices of those that were triangulated.
            places_mm: (S, 3) where they are.
            covariance_mm2: (S, 3, 3) of each.
            face_mm: distance of the targets' faces from the axis.
            tube: the ideal tube.
        """
        radial = _radial(places_mm)
        weight = 1 / np.einsum("ni,nij,nj->n", radial, covariance_mm2, radial)
        x_mm, away = places_mm[:, 0], np.hypot(places_mm[:, 1], places_mm[:, 2]) - face_mm
        taper = -float((weight * x_mm * away).sum() / (weight * x_mm**2).sum())
        tube = replace(tube, taper=taper)
        departures = _Departures.of(HalfTube(tube), places_mm, away + taper * x_mm, 1 / weight)
        half = HalfTube(tube, departures.control)
        return cls(half, face_mm, seen, places_mm, covariance_mm2, departures)

    def glued(self, nominal_mm: Array, lines: SightLines | None) -> Glued:
        """All targets: as triangulated, where a ray meets the wall, or else where they should be.

        Args:
            nominal_mm: (N, 3) nominal places in the liner's frame.
            lines: rays of targets that one view alone sees.
        """
        places = nominal_mm.copy()
        places[self.seen] = self.places_mm
        covariance = np.tile(_UNSEEN_MM**2 * np.eye(3), (len(places), 1, 1))
        covariance[self.seen] = self.covariance_mm2
        taper = self.half.tube.taper
        if lines is not None:
            met = lines.on_wall(self._radius_mm, taper)
            places[lines.target], covariance[lines.target] = met, lines.covariance_mm2(met, taper)
        # How each place moves with the wall's departure under it; within the face, each by itself.
        radial = _radial(places)
        lean, within = radial.copy(), np.eye(3) - radial[:, :, np.newaxis] * radial[:, np.newaxis]
        if lines is not None:
            lean[lines.target] = lines.lean(met, taper)
        departure = self.departures.covariance_mm2(places)
        shared = np.einsum("ni,nm,mj->nimj", lean, departure, lean)
        each = np.arange(len(places))
        shared[each, :, each] += within @ covariance @ within
        return Glued(places, shared.reshape(places.size, -1))

    def _radius_mm(self, places_mm: Array) -> Array:
        cone_mm = self.face_mm - self.half.tube.taper * places_mm[:, 0]
        return cone_mm + self.departures.at(places_mm)


class _Departures(NamedTuple):
    """Smooth radial departure of a mounted wall from a cone.

    Attributes:
        half: the cone.
        control: (K,) control values.
        seen: (S, K) splines at the targets that showed it; `seen_mm2`: (S, S) covariance of what they showed.
    """

    half: HalfTube
    control: Array
    seen: Array
    seen_mm2: Array

    @classmethod
    def of(cls, half: HalfTube, places_mm: Array, away_mm: Array, variance_mm2: Array) -> "_Departures":
        """The departure that targets (S, 3) show which are (S,) away from the cone."""
        at = _at(half, places_mm)
        spread = _spread(half, at)
        seen_mm2 = at @ spread + np.diag(variance_mm2)
        return cls(half, spread @ np.linalg.solve(seen_mm2, away_mm), at, seen_mm2)

    def at(self, places_mm: Array) -> Array:
        """(N,) departure at places (N, 3)."""
        return _at(self.half, places_mm) @ self.control

    def covariance_mm2(self, places_mm: Array) -> Array:
        """(N, N) covariance of the departure at places (N, 3)."""
        at = _at(self.half, places_mm)
        prior = _spread(self.half, at)
        cross = self.seen @ prior
        return at @ prior - cross.T @ np.linalg.solve(self.seen_mm2, cross)


def _at(half: HalfTube, places_mm: Array) -> Array:
    """(N, K) splines at places (N, 3)."""
    s_mm = half.tube.radius_mm * np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return np.asarray(half.grid.basis(s_mm, places_mm[:, 0]).matrices[0].toarray(), np.float64)


def _spread(half: HalfTube, at: Array) -> Array:
    """(K, N) prior covariance of the control values and the departure at `at` (N, K)."""
    around, along = (
        np.exp(-0.5 * ((axis[:, np.newaxis] - axis) / _SMOOTH_MM) ** 2)
        for axis in (half.grid.around.greville, half.grid.along.greville)
    )
    return _DEPARTURE_MM**2 * np.kron(along, around) @ at.T


def _radial(places_mm: Array) -> Array:
    """(N, 3) unit vectors outward from the axis."""
    theta = np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return np.stack([np.zeros_like(theta), np.sin(theta), np.cos(theta)], axis=1)


class Frame(NamedTuple):
    """The liner's frame.

    Attributes:
        origin_mm: (3,) middle of the tube in the object's frame.
        axes: (3, 3) rows: along the tube, across, and outward through the middle of the targets.
    """

    origin_mm: Array
    axes: Array

    @classmethod
    def of(cls, grid: Grid, shape: NominalShape, middle_mm: float) -> "Frame":
        """The frame of a cylinder whose middle is at an x of the object's frame."""
        along = shape.along / np.linalg.norm(shape.along)
        along = along if along[0] >= 0 else -along
        origin = shape.origin_mm + (middle_mm - shape.origin_mm[0]) / along[0] * along
        outward = (grid.nominal_mm - origin).mean(axis=0)
        outward = outward - (outward @ along) * along
        outward = outward / np.linalg.norm(outward)
        return cls(origin, np.stack([along, np.cross(outward, along), outward]))

    def places(self, xyz_mm: Array) -> Array:
        """(N, 3) places of points (N, 3) of the object's frame."""
        return (xyz_mm - self.origin_mm) @ self.axes.T

    def covariances(self, covariance_mm2: Array) -> Array:
        """(N, 3, 3) covariances of these, from those in the object's frame."""
        return self.axes @ covariance_mm2 @ self.axes.T


@dataclass(frozen=True, slots=True, eq=False)
class Mounting:
    """A liner as mounted.

    Attributes:
        half: the half of it that faces the cameras.
        targets: where the targets of the grid are glued.
        frame: of the liner, in the object's.
        shared_mm2: (3 N, 3 N) covariance of the targets' places in every state, from that of the reference's.
        rig: whose views saw the points; None if targets that one view alone sees are of no use.
    """

    half: HalfTube
    targets: Targets
    frame: Frame
    shared_mm2: Array
    rig: Rig | None

    @classmethod
    def of(
        cls, grid: Grid, material: Material, reference: Points | None, rig: Rig | None = None
    ) -> "Mounting":
        """The liner.

        Args:
            grid: targets of the object model; they have to be on a cylinder.
            material: of the whole wall, with the ends that hold it.
            reference: targets of the open liner; None takes the object model's as exact.
            rig: whose views saw the points, for the rays of targets that one view alone sees.

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
        _check_ends(ends, grid.nominal_mm[:, 0])
        frame = Frame.of(grid, shape, sum(ends) / 2)
        nominal = frame.places(grid.nominal_mm)
        middle_mm = shape.radius_mm - material.depth_mm
        tube = MountedTube(middle_mm, 0.0, ends[1] - ends[0], material.wall_mm, material.E_mpa, material.F0_n)
        if reference is None:
            targets = _targets(nominal, middle_mm, material)
            return cls(HalfTube(tube), targets, frame, np.zeros((nominal.size,) * 2), rig)
        seen = grid.indices(reference.target)
        open_wall = OpenWall.of(
            nominal,
            seen,
            frame.places(reference.xyz_mm),
            frame.covariances(reference.covariance_mm2),
            shape.radius_mm,
            tube,
        )
        glued = open_wall.glued(nominal, _sight_lines(reference, grid, frame, rig))
        targets = _targets(glued.places_mm, middle_mm, material)
        half = open_wall.half
        # What was seen is the wall in equilibrium, not the one that it settles from.
        targets = targets._replace(x_mm=targets.x_mm - _slid_mm(half, targets))
        return cls(half, targets, frame, glued.covariance_mm2, rig)

    @property
    def face_mm(self) -> float:
        """Distance of a target's face from the wall's inner face."""
        return self.half.tube.thickness_mm + self.targets.thickness_mm

    def sights(self, points: Points, grid: Grid, shared: bool = True) -> Sights:
        """Sights of a field's targets, in the liner's frame.

        Args:
            points: of the field, with the images of targets that one view alone sees.
            grid: targets of the object model.
            shared: true if their covariance includes `shared_mm2`.
        """
        places = np.full((len(grid), 3), np.nan)
        covariance = np.zeros((len(grid), 3, 3))
        index = grid.indices(points.target)
        places[index] = self.frame.places(points.xyz_mm)
        covariance[index] = self.frame.covariances(points.covariance_mm2)
        sights = Sights.of_points(places, covariance)
        if lines := _sight_lines(points, grid, self.frame, self.rig):
            sights = sights.joined(lines.sights())
        return sights.shared(self.shared_mm2) if shared else sights

    def seen_alone(self, points: Points, grid: Grid) -> Mask:
        """(N,) True for targets that one view alone sees, if its rays can be used."""
        lines = _sight_lines(points, grid, self.frame, self.rig)
        return np.isin(np.arange(len(grid)), lines.target if lines else [])


def _sight_lines(points: Points, grid: Grid, frame: Frame, rig: Rig | None) -> SightLines | None:
    """Rays of the targets that one view alone sees; None without any."""
    images = points.single
    if rig is None or images is None or not len(images):
        return None
    index = grid.indices(images.target)
    return SightLines.of(rig, images, index, grid.nominal_mm[index], *frame)


def _targets(places_mm: Array, middle_mm: float, material: Material) -> Targets:
    """Targets glued at places (N, 3) of the open liner; `middle_mm` is the radius of its wall's middle."""
    theta = np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return Targets(middle_mm * theta, places_mm[:, 0], material.target_mm)


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
    return (settled - places.places_mm(half, half.mounted))[:, 0]
