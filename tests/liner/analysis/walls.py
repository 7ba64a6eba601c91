"""Fields of a liner whose wall was solved as a solid, by a program that shares nothing with the analysis."""

from dataclasses import replace
from functools import cache

import numpy as np

from core.geometry.rigs import calibration
from grabberd.core.geometry import Rig, project_all
from grabberd.core.reconstruction import ObjectModel, Points, SingleViewImages
from grabberd_fake.wall_states import Patch, WallStates, wall_states
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap, PressureModel
from grabberd_liner.analysis.wall.material import Material, Zone

PITCH_MM, ROWS, COLUMNS = 6.5, 18, 4
EIGHT_BITS_MM = np.array([0.010, 0.010, 0.026])
"""σ of a target's place in one field."""
ONE_BIT_MM = np.array([0.021, 0.021, 0.055])
PX_PER_MM = 3.8
"""Scale of the pictures."""
_IN_FRONT_MM = 9.0
"""Of the liner's axis: where the rig looks at."""


def rig() -> Rig:
    """The rig that sees the liner, in the liner's frame."""
    views = [replace(view, Z0_mm=view.Z0_mm + _IN_FRONT_MM) for view in calibration().views]
    return Rig.of_views(views)


class SolvedLiner:
    """A liner on a teat, with targets glued to it in rows and columns."""

    def __init__(
        self,
        name: str,
        columns: int = COLUMNS,
        states: WallStates | None = None,
        row_pitch_mm: float = PITCH_MM,
    ) -> None:
        """Reads its table, unless its states are given."""
        self.name = name
        self.states = states or wall_states(name)
        self.design = self.states.about["design"]
        face_mm = self.design["radius_mm"] + self.design["wall_mm"] / 2
        rows = 1 + int((ROWS - 1) * PITCH_MM / row_pitch_mm)
        self.x_mm = (np.arange(rows) - (rows - 1) / 2) * row_pitch_mm
        theta = (np.arange(columns) - (columns - 1) / 2) * PITCH_MM / face_mm
        self.theta, self._face_mm = theta, face_mm
        self._patch = Patch(self.states, self.x_mm, theta)
        row, column = (part.ravel() for part in np.meshgrid(range(rows), range(columns), indexing="ij"))
        angle = theta[column]
        nominal = np.column_stack([self.x_mm[row], face_mm * np.sin(angle), face_mm * np.cos(angle)])
        ids = np.arange(len(row), dtype=np.int32)
        model = ObjectModel("liner", ids, nominal, row.astype(np.int32), column.astype(np.int32), 1.5, 0.3)
        self.grid = Grid.of(model)

    @property
    def inner(self) -> np.ndarray:
        """(N,) True for targets that are not in the first or last column."""
        return (self.grid.column > 0) & (self.grid.column < self.grid.column.max())

    def places_mm(self, outer_kpa: float) -> np.ndarray:
        """(N, 3) targets at a pressure difference."""
        return self._places_mm(self._patch, outer_kpa)

    def moved_mm(self, outer_kpa: float, along_mm: float, round_mm: float) -> np.ndarray:
        """(N, 3) targets, had they been glued farther along and round the liner."""
        moved = Patch(self.states, self.x_mm + along_mm, self.theta + round_mm / self._face_mm)
        return self._places_mm(moved, outer_kpa)

    def across_mm(self, outer_kpa: float) -> np.ndarray:
        """(N, 3) targets, had the liner been turned by a quarter, so that its folds face the cameras."""
        patch = Patch(self.states, self.x_mm, self.theta + np.pi / 2)
        x, y, z = self._places_mm(patch, outer_kpa).T
        return np.column_stack([x, -z, y])

    def _places_mm(self, patch: Patch, outer_kpa: float) -> np.ndarray:
        points, _ = patch.surface(self.states.outer_mm(outer_kpa))
        return points.reshape(-1, 3)

    def contact_kpa(self, outer_kpa: float) -> np.ndarray:
        """(N,) contact pressure under the targets."""
        return self._patch.values(self.states.contact_kpa(outer_kpa)).ravel()

    def values_kpa(self, outer_kpa: float, x_mm: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """(R, C) contact pressure at heights and angles of the mounted tube."""
        return Patch(self.states, x_mm, theta).values(self.states.contact_kpa(outer_kpa))

    def points(self, outer_kpa: float, seed: int, sigma_mm: np.ndarray = EIGHT_BITS_MM) -> Points:
        """Points of one field, with noise."""
        noise = np.random.default_rng(seed).normal(size=(len(self.grid), 3)) * sigma_mm
        return as_points(self.places_mm(outer_kpa) + noise, sigma_mm)

    def zones(self, **changed: float | None) -> list[Zone]:
        """Material as a researcher would give it after a ramp with the empty liner."""
        design = self.design
        values = {
            "E_mpa": design["young_mpa"],
            "wall_mm": design["wall_mm"],
            "F0_n": design["pretension_n"],
            "E_sigma_mpa": 0.035 * design["young_mpa"],
            "wall_sigma_mm": 0.02 * design["wall_mm"],
            "F0_sigma_n": 0.1 * design["pretension_n"],
            "first_end_mm": -65.0,
            "last_end_mm": 65.0,
        } | changed
        material = Material(
            poisson=0.5,
            radius_mm=design["radius_mm"],
            target_mm=0.0,
            law="neo_hookean",
            **values,
        )
        return [Zone(-10.0, 200.0, material)]


def pressure_map(
    model: PressureModel, points: Points, within: np.ndarray, vacuum: ChamberVacuum
) -> PressureMap:
    """The pressure at one field."""
    return model.of_settled(model.settled(points, vacuum), within, vacuum)


@cache
def solved(name: str) -> SolvedLiner:
    """A liner, read once."""
    return SolvedLiner(name)


@cache
def solved_six(name: str) -> SolvedLiner:
    """A liner with six columns of targets, read once."""
    return SolvedLiner(name, 6)


def as_points(places_mm: np.ndarray, sigma_mm: np.ndarray) -> Points:
    """Points of all targets."""
    count = len(places_mm)
    return Points(
        np.arange(count, dtype=np.int32),
        places_mm,
        np.tile(np.diag(np.square(sigma_mm)), (count, 1, 1)),
        np.zeros((count, 3, 3)),
        np.zeros((count, 2, 2)),
        np.zeros(count),
    )


def with_noise(
    liner: SolvedLiner, places_mm: np.ndarray, sigma_mm: np.ndarray, random: np.random.Generator
) -> Points:
    """A field with noise in which both views see all targets."""
    return as_points(places_mm + random.normal(size=places_mm.shape) * sigma_mm, sigma_mm)


def outermost_alone(
    liner: SolvedLiner, places_mm: np.ndarray, sigma_mm: np.ndarray, random: np.random.Generator
) -> Points:
    """A field with noise in which one view alone sees the first column, and the other view the last one."""
    noisy = with_noise(liner, places_mm, sigma_mm, random)
    alone = np.flatnonzero(~liner.inner)
    view = (liner.grid.column[alone] > 0).astype(np.intp)
    image_px = project_all(rig(), places_mm[alone])[:, view, np.arange(len(alone))].T
    sigma_px = np.full((len(alone), 2), PX_PER_MM * np.sqrt(2.0) * sigma_mm[1])
    image_px = image_px + random.normal(size=image_px.shape) * sigma_px
    single = SingleViewImages(liner.grid.target[alone], view, image_px, sigma_px)
    return replace(noisy.select(liner.inner), single=single)
