"""The mounted liner in its own frame, from the object model, the material and the reference state."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.mounted.open_wall import OpenWall
from grabberd_liner.analysis.load.mounted.sight_lines import SightLines
from grabberd_liner.analysis.load.mounted.sights import Sights
from grabberd_liner.analysis.load.mounted.target_places import TargetPlaces, Targets
from grabberd_liner.analysis.surface.nominal_shape import NominalShape
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.material import Material

Array = NDArray[np.float64]


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
        places: Array = (xyz_mm - self.origin_mm) @ self.axes.T
        return places

    def covariances(self, covariance_mm2: Array) -> Array:
        """(N, 3, 3) covariances of these, from those in the object's frame."""
        covariances: Array = self.axes @ covariance_mm2 @ self.axes.T
        return covariances


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

    def seen_alone(self, points: Points, grid: Grid) -> NDArray[np.bool_]:
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
    slid_mm: Array = (settled - places.places_mm(half, half.mounted))[:, 0]
    return slid_mm
